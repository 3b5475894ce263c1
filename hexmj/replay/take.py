"""What a film shows of a recording: the measured walk of a physical insect, or the plan that a puppet shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from hexmj.bodies.ground import ground_level
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.replay.recording import recorded_conditions
from hexmj.replay.schema import check_recording
from hexmj.rotations import heading, turned
from hexmj.stability import support_polygon


@dataclass(frozen=True, eq=False)
class Take:
    """The numbers of one recording, in memory; only steps with a pose, so none after a fall."""

    title: str
    physical: bool
    """Whether a physical insect was recorded, or a puppet."""
    conditions: Conditions
    """Of the walk."""
    step: float
    """Duration of a step [s]."""
    begin: float
    """When the first step begins [s]; above 0 in a part of a recording."""
    end: float
    """When what was recorded ends [s], also beyond a fall."""
    velocity: np.ndarray
    """(step,) V_r as a fraction of V_p."""
    margin: np.ndarray
    """(step,) stability margin [mm]."""
    stance: np.ndarray
    """(step, leg) which feet stand."""
    feet: np.ndarray
    """(step, leg, 2) feet in the world [mm]."""
    planned_tip: np.ndarray
    """(step, leg, 3) planned tips in the world [mm]."""
    centre_of_mass: np.ndarray
    """(step, 3) in the world [mm]."""
    qpos: np.ndarray
    """(step, position) of the insect."""
    lost: float
    """First loss of static stability [s], inf for none."""
    fell: float
    """Fall [s], inf for none."""
    part: str
    """Part of the trunk that touched the ground first, where `fell` is finite."""

    @classmethod
    def of(cls, recording: xr.Dataset, body: Body = STICK_INSECT) -> "Take":
        """Read a recording of a body."""
        qpos = recording["qpos"].values
        shown = slice(np.isfinite(qpos).all(axis=1).sum())
        if shown.stop == 0:
            raise InputError(f"the recording {recording.attrs['title']!r} holds no pose; expected at least one")
        physical = "measured_stance" in recording
        kind = "measured" if physical else "planned"
        few, conditions = recording.isel(step=shown), recorded_conditions(recording, body)
        if physical and not -1 <= (part := int(recording["fall_part"])) < len(body.trunk):
            raise InputError(f"a recording has fall_part = {part}; expected 0 to {len(body.trunk) - 1}, or -1 for none")
        centre, vp = few["centre_of_mass"].values, conditions.vp
        step = float(recording.attrs["dt"]) / vp
        ahead = few[f"{kind}_x"].values + np.tile(recording.attrs["origins"], 2)
        seen = np.stack([ahead, few[f"{kind}_y"].values], axis=-1)
        return cls(
            title=recording.attrs["title"],
            physical=physical,
            conditions=conditions,
            step=step,
            begin=float(recording["seconds"][0]) - step,
            end=float(recording["seconds"][-1]),
            velocity=few["velocity"].values,
            margin=few[f"{kind}_margin"].values,
            stance=few[f"{kind}_stance"].values.astype(bool),
            feet=centre[:, None, :2] + turned(seen, heading(qpos[shown, 3:7])),
            planned_tip=few["planned_tip"].values,
            centre_of_mass=centre,
            qpos=qpos[shown],
            lost=float(recording[f"{kind}_loss_time"]) / vp,
            fell=float(recording["fall_time"]) / vp if physical else np.inf,
            part=body.trunk[int(recording["fall_part"])] if physical else "",
        )

    def row(self, seconds: float) -> int:
        """The step whose end is nearest to a time; the first one before the beginning, the last one after the end."""
        return int(np.clip(round((seconds - self.begin) / self.step) - 1, 0, len(self.qpos) - 1))


def takes_of(recordings: Sequence[xr.Dataset], body: Body = STICK_INSECT) -> list[Take]:
    """Read recordings of a body.

    Raises:
        InputError: what is no recording, holds no pose, or is of another body.
    """
    try:
        for recording in recordings:
            check_recording(recording)
        return [Take.of(recording, body) for recording in recordings]
    except (OSError, RuntimeError) as error:  # of a file opened by xarray
        raise InputError(f"a recording is damaged ({error}); expected one as `hexmj walk` writes it") from None


def margin_in_words(margin: float) -> str:
    """A stability margin [mm] as films and views tell it; it is infinite where no foot stands."""
    return f"margin {margin:+.1f} mm" if np.isfinite(margin) else "no foot stands"


def support_on_ground(
    conditions: Conditions, feet: np.ndarray, stance: np.ndarray, centre: np.ndarray
) -> tuple[np.ndarray, float]:
    """Corners of the support polygon, (corner, 2), none without a foot, and the height at which it is drawn: that of
    the highest ground below it.

    Of feet, (leg, 2), as far as they stand, (leg,), and a centre of mass, (3,), in the world; all [mm].
    """
    corners = support_polygon(feet, stance)
    below = np.vstack([corners, centre[:2]])
    return corners, float(ground_level(conditions, below).max())
