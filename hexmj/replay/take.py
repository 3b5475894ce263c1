"""`Take`, the part of a recording that films and pages show; the figure with footfall diagram and stability margin."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from hexmj.bodies.ground import ground_level
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.plotting import LEGEND, MEASURE_STYLES, head, in_figure, picture
from hexmj.replay.recording import check_recording, recorded_conditions
from hexmj.stability import support_polygon
from hexmj.walks import spans

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Take:
    """Arrays of one recording for films and pages. They end at a fall, because later steps have no pose."""

    title: str
    physical: bool
    """True for a physical walk, False for a plan."""
    conditions: Conditions
    """Conditions of the walk."""
    step: float
    """Duration of a step [s]."""
    begin: float
    """Time at which the first step begins [s]; above 0 if the beginning of the recording was cut off."""
    end: float
    """End of the recording [s], which may be after a fall."""
    velocity: np.ndarray
    """(step,) V_r as a fraction of V_p."""
    margin: np.ndarray
    """(step,) stability margin [mm] of the feet at the ground in a physical walk, otherwise of the planned feet."""
    stance: np.ndarray
    """(step, leg) True where a foot is at the ground in a physical walk, otherwise where it stands in the plan."""
    feet: np.ndarray
    """(step, leg, 2) horizontal positions of the feet in the world [mm]."""
    planned_tip: np.ndarray
    """(step, leg, 3) commanded tips in the world [mm]."""
    centre_of_mass: np.ndarray
    """(step, 3) centre of mass in the world [mm]."""
    qpos: np.ndarray
    """(step, position) MuJoCo's positions of the root and the joints."""
    lost: float
    """Time of the first loss of static stability [s]; inf without a loss."""
    fell: float
    """Time of the fall [s]; inf without a fall."""
    part: str
    """Part of the trunk that touched the ground first; "" without a fall."""

    @classmethod
    def of(cls, recording: xr.Dataset, body: Body = STICK_INSECT) -> "Take":
        """Read a recording of a body.

        Raises:
            InputError: the dataset is not a recording, is of another body, or contains no pose.
        """
        check_recording(recording)
        conditions = recorded_conditions(recording, body)
        poses = int(np.isfinite(recording["qpos"].values).all(axis=1).sum())
        if poses == 0:
            raise InputError(f"the recording {recording.attrs['title']!r} contains no pose; expected at least one")
        physical = "grounded_stance" in recording
        kind, tip = ("grounded", "tip") if physical else ("planned", "planned_tip")
        shown, vp = recording.isel(step=slice(poses)), conditions.vp
        step = float(recording.attrs["dt"]) / vp
        part = int(recording["fall_part"]) if physical else -1
        return cls(
            title=recording.attrs["title"],
            physical=physical,
            conditions=conditions,
            step=step,
            begin=float(recording["seconds"][0]) - step,
            end=float(recording["seconds"][-1]),
            velocity=shown["velocity"].values,
            margin=shown[f"{kind}_margin"].values,
            stance=shown[f"{kind}_stance"].values.astype(bool),
            feet=shown[tip].values[..., :2],
            planned_tip=shown["planned_tip"].values,
            centre_of_mass=shown["centre_of_mass"].values,
            qpos=shown["qpos"].values,
            lost=float(recording[f"{kind}_loss_time"]) / vp,
            fell=float(recording["fall_time"]) / vp if physical else np.inf,
            part=body.trunk[part] if part >= 0 else "",
        )

    def row(self, seconds: float) -> int:
        """Return the index of the step whose end is nearest to a time [s], among the steps with a pose."""
        return int(np.clip(round((seconds - self.begin) / self.step) - 1, 0, len(self.qpos) - 1))

    def support(self, row: int) -> tuple[np.ndarray, float]:
        """Return the support polygon at the end of a step, and the height at which it is drawn [mm]."""
        return support_on_ground(self.conditions, self.feet[row], self.stance[row], self.centre_of_mass[row])


def takes_of(recordings: Sequence[xr.Dataset], body: Body) -> list[Take]:
    """Read recordings of a body.

    Raises:
        InputError: there is no recording, or `Take.of` cannot read one.
    """
    if not len(recordings):
        raise InputError("no recordings; expected one or more")
    return [Take.of(recording, body) for recording in recordings]


def margin_in_words(margin: float) -> str:
    """Return a stability margin [mm] as a text; an infinite margin means that no foot stands."""
    return f"margin {margin:+.1f} mm" if np.isfinite(margin) else "no foot stands"


def support_on_ground(
    conditions: Conditions, feet: np.ndarray, stance: np.ndarray, centre: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the support polygon, (corner, 2), and the height at which it is drawn, its highest ground [mm].

    Args:
        conditions: conditions of the walk, which define the ground.
        feet: horizontal positions in the world, (leg, 2) [mm].
        stance: True for feet that stand, (leg,).
        centre: centre of mass in the world, (3,) [mm].
    """
    corners = support_polygon(feet, stance)
    below = np.vstack([corners, centre[:2]])
    return corners, float(ground_level(conditions, below).max())


def walk_figure(recording: xr.Dataset) -> "Figure":
    """Draw the footfall diagram and the stability margin of a recording over time.

    A bar is a foot off the ground; in the recording of a plan, it is a protraction.

    Args:
        recording: a recording, or consecutive steps of it.
    """
    figure = picture(8.0, 5.0)
    footfall, margin = figure.subplots(2, 1, sharex=True, height_ratios=(1.2, 1.0))
    time, planned = recording.time.values, recording.planned_stance.values
    physical = "grounded_stance" in recording
    stance = recording.grounded_stance.values if physical else planned
    shown = np.isfinite(recording.qpos.values).all(axis=1)  # False after a fall
    blue, orange, red = (MEASURE_STYLES[measure]["color"] for measure in ("kinematic", "grounded", "physical"))
    for row in range(6):
        off = spans(time, ~stance[:, row] & shown)
        footfall.broken_barh(off, (row - 0.38, 0.5 if physical else 0.76), color=orange if physical else blue)
        if physical:
            footfall.broken_barh(spans(time, ~planned[:, row]), (row + 0.16, 0.22), color=blue)
    footfall.set(ylim=(5.6, -0.6), yticks=range(6), yticklabels=LEGS, ylabel="bars: foot off\nthe ground")
    margin.axhline(0.0, color="0.6", linewidth=0.8)
    margin.plot(time, recording.planned_margin, color=blue, linewidth=1.2, label="planned")
    events = {"kinematic loss": float(recording.planned_loss_time), "dynamic loss": float(recording.dynamic_loss_time)}
    if physical:
        known = np.where(np.isfinite(recording.grounded_margin), recording.grounded_margin, np.nan)
        margin.plot(time, known, color=orange, linewidth=1.2, label="grounded: feet at the ground")
        events["grounded loss"] = float(recording.grounded_loss_time)
        events["trunk on the ground"] = fall = float(recording.fall_time)
        if fall <= time[-1]:
            margin.axvline(fall, color=red, linewidth=1.6, linestyle="-.", label="fall: trunk on the ground")
    margin.set(xlabel="time [time units]", ylabel="stability margin [mm]", xlim=(0.0, time[-1]))
    figure.legend(**LEGEND, loc="outside lower center", ncols=3)
    for axes in (footfall, margin):
        axes.spines[["top", "right"]].set_visible(False)
    happened = [f"{event} at t = {at:.1f}" for event, at in events.items() if at <= time[-1]]
    conditions = f"$V_p$ = {recording.attrs['vp']:g} mm/s; one time unit is 1 mm / $V_p$"
    head(figure, "; ".join(happened) or "neither a loss nor a fall", in_figure(recording.attrs["title"]), conditions)
    return figure
