"""What a recording holds: a table of its variables and attributes, each with its type and range, which is checked."""

import math
from dataclasses import asdict
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from hexmj.body import ROOT_QPOS
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS, Geometry
from hexmj.timing import Stride

FAR = 1e6
"""Farther than anybody walks [mm]."""

ROUNDING = 1e-6
"""By which numbers may differ that follow from others."""


class Told(NamedTuple):
    """What is known of a variable."""

    dimensions: tuple[str, ...]
    dtype: type
    least: float
    most: float
    units: str
    long_name: str
    gaps: str = ""
    """Where it is NaN: nowhere, 'after a fall', or 'as a whole' where there is nothing to tell."""


_LEGS, _STEPS, _ONCE = ("step", "leg"), ("step",), ()
_TIPS = ("step", "leg", "coordinate")
_INF = math.inf

TIMES = {
    "time": Told(_STEPS, float, 0, FAR, "time unit", "time, in the unit 1 mm / V_p"),
    "seconds": Told(_STEPS, float, 0, 10 * FAR, "s", "time"),
}

PLANNED = {
    "velocity": Told(_STEPS, float, 0, 1, "V_p", "commanded velocity V_r during the step"),
    "planned_x": Told(_LEGS, float, -FAR, FAR, "mm", "planned tip on its own axis"),
    "planned_y": Told(_LEGS, float, -FAR, FAR, "mm", "planned tip beside the body axis, left positive"),
    "planned_stance": Told(_LEGS, bool, 0, 1, "1", "leg retracts in the plan"),
    "planned_margin": Told(_STEPS, float, -_INF, FAR, "mm", "stability margin of the plan"),
    "planned_loss_time": Told(_ONCE, float, 0, _INF, "time unit", "first loss of static stability of the plan, or inf"),
    "planned_tip": Told(_TIPS, float, -FAR, FAR, "mm",
                        "where the tip was told to be in the world, lifted while it swings", "after a fall"),
    "qpos": Told(("step", "position"), float, -FAR, FAR, "mm, 1, rad",
                 "root's position and unit quaternion, joint angles", "after a fall"),
    "centre_of_mass": Told(("step", "coordinate"), float, -FAR, FAR, "mm",
                           "centre of mass in the world", "after a fall"),
}  # fmt: skip
"""Variables of every recording."""

MEASURED = {
    "measured_x": Told(
        _LEGS, float, -FAR, FAR, "mm", "foot ahead of the centre of mass, from the origin of its axis", "after a fall"
    ),
    "measured_y": Told(_LEGS, float, -FAR, FAR, "mm", "foot beside the centre of mass, left positive", "after a fall"),
    "measured_stance": Told(_LEGS, bool, 0, 1, "1", "foot touches the ground"),
    "measured_margin": Told(_STEPS, float, -_INF, FAR, "mm", "measured stability margin", "after a fall"),
    "measured_loss_time": Told(
        _ONCE, float, 0, _INF, "time unit", "first loss of measured static stability, or inf"
    ),
    "fall_time": Told(_ONCE, float, 0, _INF, "time unit", "first contact of the trunk with the ground, or inf"),
    "fall_part": Told(_ONCE, int, -1, FAR, "1", "part that touched the ground first, from 0 at the front; -1 for none"),
    "clearance": Told(_ONCE, float, -FAR, FAR, "mm", "least height of the trunk's lowest point"),
    "tilt": Told(_ONCE, float, 0, math.pi, "rad", "greatest tilt of the trunk"),
    "speed": Told(
        _ONCE, float, -FAR, FAR, "1", "distance walked ahead over distance commanded, until the fall", "as a whole"
    ),
    "slip": Told(_ONCE, float, 0, FAR, "mm/s", "mean sliding speed of a foot in contact", "as a whole"),
    "tracking": Told(
        _ONCE, float, 0, _INF, "mm", "95th percentile of the distance between a foot and its target on the ground",
        "as a whole",
    ),
    "depth": Told(_ONCE, float, 0, FAR, "mm", "how deep the deepest foot was in the ground until the fall"),
    "saturation": Told(_ONCE, float, 0, 1, "1", "fraction of joints times physics steps at the torque limit"),
    "unreachable": Told(_ONCE, int, 0, _INF, "1", "tip targets out of reach"),
}  # fmt: skip
"""Variables of a recorded physical insect; a puppet that only shows the plan has none of them."""


def stride_settings(stride: Stride) -> dict[str, Any]:
    """A stride in one flat table that NetCDF and JSON can hold."""
    settings = asdict(stride)
    return settings | {name: list(values) for name, values in settings.pop("geometry").items()}


SETTINGS = {"title": "", **Conditions().settings(), **stride_settings(Stride())}
"""Attributes, each with a value of its type: title, conditions, the body's name, the stride."""


def check_recording(recording: xr.Dataset) -> None:
    """Refuse what is no recording of any body.

    Raises:
        InputError: a variable or attribute is missing, or is not what the tables say, or does not follow from those
            that it follows from.
    """
    expected = TIMES | PLANNED | (MEASURED if set(MEASURED) & set(recording.variables) else {})
    if missing := [name for name in expected if name not in recording.variables]:
        raise InputError(f"no recording; missing: {', '.join(missing)}")
    check_settings(recording)
    for name, labels in {"leg": list(LEGS), "coordinate": list("xyz")}.items():
        given = recording[name].values.tolist() if name in recording.coords else None
        if given != labels:
            raise InputError(f"no recording: {name} = {given}; expected {labels}")
    for name, one in expected.items():
        if (values := recording[name]).dims != one.dimensions or values.dtype != np.dtype(one.dtype) or not values.size:
            raise InputError(
                f"no recording: {name} is {values.dtype} of {dict(values.sizes)};"
                f" expected {np.dtype(one.dtype)} over {one.dimensions}"
            )
    if recording.sizes["position"] <= ROOT_QPOS:
        raise InputError(
            f"no recording: {recording.sizes['position']} positions; expected more than the root's {ROOT_QPOS}"
        )
    poses = np.asarray(np.isfinite(recording["qpos"].values).all(axis=1))
    for name, one in expected.items():
        _check_range(name, one, recording[name].values, poses)
    _check_laws(recording, int(poses.sum()))


def check_settings(recording: xr.Dataset) -> None:
    """Refuse attributes that are missing or of another type than those of a recording, and a stride without sense.

    Raises:
        InputError: there is one.
    """
    given = recording.attrs
    if missing := [name for name in SETTINGS if name not in given]:
        raise InputError(f"no recording; missing: attribute {', attribute '.join(missing)}")
    for name, usual in SETTINGS.items():
        if not _alike(given[name], usual):
            value = np.asarray(given[name]).tolist()
            raise InputError(f"no recording: attribute {name} = {value!r:.80}; expected one such as {usual!r}")
    if not (title := given["title"]).isprintable() or len(title) > 1000:
        raise InputError(f"no recording: title = {title!r:.80}; expected at most {1000} printable characters")
    lines: Any = {name: tuple(map(float, given[name])) for name in ("origins", "lateral")}
    Stride(**{name: float(given[name]) for name in ("aep0", "pep0", "pep_min", "dt")}, geometry=Geometry(**lines))


def _alike(value: Any, usual: Any) -> bool:
    """Whether a value is of the type of another, and finite."""
    if isinstance(usual, str):
        return isinstance(value, str)
    if isinstance(usual, list):
        return np.shape(value) == np.shape(usual) and all(map(_alike, value, usual))
    kind = Integral if isinstance(usual, int) else Real
    return isinstance(value, kind) and not isinstance(value, bool) and math.isfinite(value)


def _check_range(name: str, one: Told, values: np.ndarray, poses: np.ndarray) -> None:
    """Refuse values out of range, and gaps but where they may be; `poses`, (step,), says whether a pose is known."""
    unknown = np.isnan(values)
    well = (one.least <= values) & (values <= one.most)
    if one.gaps == "after a fall":
        known = poses.reshape(-1, *(1,) * (values.ndim - 1))
        if (beyond := ~known & ~unknown).any():
            step = np.argwhere(beyond)[0][0]
            raise InputError(
                f"no recording: {name} holds {values[beyond].flat[0]} in step {step}, of which qpos is not finite"
                " throughout; expected a pose, or NaN in all that is unknown after a fall"
            )
        well |= ~known
    elif one.gaps == "as a whole":
        well |= unknown
    if not well.all():
        wrong = values[~well].flat[0]
        gaps = f", NaN {one.gaps} only" if one.gaps else ""
        raise InputError(
            f"no recording: {name} holds {wrong}; expected {one.least:g} to {one.most:g} {one.units}{gaps}"
        )


def _check_laws(recording: xr.Dataset, poses: int) -> None:
    """Refuse times that are not those of the steps, poses after a fall, and quaternions that turn nothing."""
    time, dt, vp = recording["time"].values, recording.attrs["dt"], recording.attrs["vp"]
    first = max(1, round(time[0] / dt)) if np.isfinite(time[0]) else 1  # of a part of a walk, another than 1
    if not np.allclose(time, dt * np.arange(first, first + len(time)), ROUNDING, 0.0):
        raise InputError(f"no recording: time is not that of {len(time)} steps of dt = {dt} time units")
    if not np.allclose(recording["seconds"].values * vp, time, ROUNDING, 0.0):
        raise InputError(f"no recording: seconds are not time over vp = {vp} mm/s")
    qpos = recording["qpos"].values
    if np.isnan(qpos[:poses]).any():
        raise InputError("no recording: qpos is known again after it was unknown; expected a fall to be the end")
    if "fall_time" in recording:
        _check_fall(recording["fall_time"].item(), recording["fall_part"].item(), time, poses)
    if not np.allclose((qpos[:poses, 3:7] ** 2).sum(axis=1), 1.0, ROUNDING, ROUNDING):
        raise InputError("no recording: qpos holds a quaternion that is not of unit length")


def _check_fall(fall: float, part: int, time: np.ndarray, poses: int) -> None:
    """Refuse a fall of no part, a part without a fall, and poses that are known after it or unknown before."""
    if math.isfinite(fall) != (part >= 0):
        raise InputError(f"no recording: fall_time = {fall:g} and fall_part = {part}; expected a fall to have its part")
    before = int((time <= fall + ROUNDING).sum())
    if poses != before:
        raise InputError(f"no recording: {poses} poses are known; expected the {before} before fall_time = {fall:g}")
