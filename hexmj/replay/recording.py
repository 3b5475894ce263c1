"""Recordings: one start of a walk as a file, with all that figures and films need."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hexmj.bodies.description import ROOT_QPOS, Body
from hexmj.bodies.loading import compile_body
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.measures.compare import REPORTED
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.orders import hold
from hexmj.results import write_whole
from hexmj.rotations import rotated
from hexmj.stability import loss_time, walk_margin
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, one_start

_LEGS, _STEPS, _ONCE = ("step", "leg"), ("step",), ()
_TIPS = ("step", "leg", "coordinate")

PLANNED = {  # dimensions, units, long_name
    "velocity": (_STEPS, "V_p", "commanded velocity V_r during the step"),
    "planned_x": (_LEGS, "mm", "planned tip on its own axis"),
    "planned_y": (_LEGS, "mm", "planned tip beside the body axis, left positive"),
    "planned_stance": (_LEGS, "1", "leg retracts in the plan"),
    "planned_margin": (_STEPS, "mm", "stability margin of the plan"),
    "planned_loss_time": (_ONCE, "time unit", "first loss of static stability of the plan, or inf"),
    "planned_tip": (_TIPS, "mm", "where the tip was told to be in the world, lifted while it swings"),
    "qpos": (("step", "position"), "mm, 1, rad", "root's position and unit quaternion, joint angles"),
    "centre_of_mass": (("step", "coordinate"), "mm", "centre of mass in the world"),
}
"""Variables of every recording."""

MEASURED = {
    "measured_x": (_LEGS, "mm", "foot ahead of the centre of mass, from the origin of its axis"),
    "measured_y": (_LEGS, "mm", "foot beside the centre of mass, left positive"),
    "measured_stance": (_LEGS, "1", "foot touches the ground"),
    "measured_margin": (_STEPS, "mm", "measured stability margin"),
    "measured_loss_time": (_ONCE, "time unit", "first loss of measured static stability, or inf"),
    "fall_time": (_ONCE, "time unit", "first contact of the trunk with the ground, or inf"),
    "fall_part": (_ONCE, "1", "part that touched the ground first, from 0 at the front; -1 for none"),
    "clearance": (_ONCE, "mm", "least height of the trunk's lowest point"),
    "tilt": (_ONCE, "rad", "greatest tilt of the trunk"),
    "speed": (_ONCE, "1", "distance walked ahead over distance commanded, until the fall"),
    "slip": (_ONCE, "mm/s", "mean sliding speed of a foot in contact"),
    "tracking": (_ONCE, "mm", "95th percentile of the distance between a foot and its target on the ground"),
    "depth": (_ONCE, "mm", "how deep the deepest foot was in the ground until the fall"),
    "saturation": (_ONCE, "1", "fraction of joints times physics steps at the torque limit"),
    "unreachable": (_ONCE, "1", "tip targets out of reach"),
}
"""Variables of a recorded physical insect; a puppet that only shows the plan has none of them."""

_TIMES = {
    "time": (_STEPS, "time unit", "time, in the unit 1 mm / V_p"),
    "seconds": (_STEPS, "s", "time"),
}


def record(walk: PhysicalWalk, start: int = 0, title: str = "") -> xr.Dataset:
    """What the physical insect did from one start, and what was planned; NaN after a fall.

    Args:
        walk: physical walks kept whole.
        start: which of them.
        title: shown on films.
    """
    planned, measured = one_start(walk.planned, start), one_start(walk.measured, start)
    qpos, outcomes = walk.qpos[:, start], walk.outcomes
    tips, _ = _lifted_tips(one_start(walk.ordered, start), walk.conditions, walk.stride)
    return _dataset(
        planned,
        walk.conditions,
        walk.stride,
        title,
        planned_tip=qpos[:, None, :3] + rotated(qpos[:, None, 3:7], tips),
        measured_x=measured.x[:, 0],
        measured_y=measured.y[:, 0],
        measured_stance=measured.stance[:, 0],
        measured_margin=walk_margin(measured)[:, 0],
        measured_loss_time=outcomes.measured_loss[start],
        fall_time=outcomes.fall[start],
        fall_part=outcomes.fall_part[start],
        **{name: getattr(outcomes, name)[start] for name in REPORTED},
        qpos=qpos,
        centre_of_mass=walk.centre_of_mass[:, start],
    )


def record_plan(
    plan: PlannedWalk, conditions: Conditions, stride: Stride, start: int = 0, title: str = ""
) -> xr.Dataset:
    """A puppet that shows the plan of one start: carried along at V_r, its joints put where the tips are planned.

    Its trunk stays level at the standing height and its centre of mass is the paper's O.  A leg that cannot
    reach its tip keeps its last angles.

    Args:
        plan: planned walks from their first step on.
        conditions: what the plan leaves open: V_p, and how high and how fast feet are lifted.
        stride: of the plan.
        start: which of the walks.
        title: shown on films.
    """
    planned = one_start(plan, start)
    compiled = compile_body(conditions)
    tips, first = _lifted_tips(planned, conditions, stride)
    root = np.zeros((len(plan.time), ROOT_QPOS))
    root[:, 0] = np.cumsum(planned.velocity[:, 0]) * stride.dt
    root[:, 2] = conditions.path.standing_height + compiled.foot_radius
    root[:, 3] = 1.0
    joints, reachable = compiled.inverse(tips)
    standing, stands = compiled.inverse(first)
    if not stands.all():
        leg = int(np.argmin(stands))
        raise InputError(f"leg {LEGS[leg]} cannot reach its tip at time 0, {first[leg].round(3).tolist()} mm")
    if not reachable.all():
        hold(joints, standing)
    return _dataset(
        planned,
        conditions,
        stride,
        title,
        planned_tip=root[:, None, :3] + tips,
        qpos=np.concatenate([root, joints.reshape(len(joints), -1)], axis=1),
        centre_of_mass=root[:, :3],
    )


def save_recording(recording: xr.Dataset, path: Path | str) -> Path:
    """Write a recording as NetCDF; the file appears whole or not at all."""
    return write_whole(Path(path), lambda part: recording.to_netcdf(part, engine="h5netcdf"))


def load_recording(path: Path | str) -> xr.Dataset:
    """Open a recording.  Numbers are read when they are used, so close it after that, best in a `with` statement.

    Raises:
        InputError: no recording of ours.
    """
    if not Path(path).is_file():
        raise InputError(f"{path} is no file; expected a recording")
    try:
        recording = xr.open_dataset(path, engine="h5netcdf")
    except (OSError, ValueError, KeyError, RuntimeError):
        raise InputError(f"{path} cannot be read as NetCDF; expected a recording") from None
    expected = _TIMES | PLANNED | (MEASURED if set(MEASURED) & set(recording.variables) else {})
    missing = [name for name in expected if name not in recording.variables]
    settings = ("title", *Conditions().settings(), *_settings(Stride()))
    missing += [f"attribute {name}" for name in settings if name not in recording.attrs]
    if missing:
        recording.close()
        raise InputError(f"{path} is no recording; missing: {', '.join(missing)}")
    for name, (dimensions, *_) in expected.items():
        if recording[name].dims != dimensions or recording[name].dtype.kind not in "fib":
            recording.close()
            raise InputError(f"{path} is no recording: {name} is not a table of numbers over {dimensions}")
    if recording.sizes["leg"] != len(LEGS):
        recording.close()
        raise InputError(f"{path} is no recording of a body with {len(LEGS)} legs")
    return recording


def recorded_conditions(recording: xr.Dataset, body: Body = STICK_INSECT) -> Conditions:
    """The conditions of a recorded walk of a body.

    Raises:
        InputError: one that makes no sense, or the recording is of another body.
    """
    if (name := recording.attrs["body"]) != body.name:
        raise InputError(f"the recording is of the body {name!r}, not of {body.name!r}; expected its own description")
    if (found := recording.sizes["position"]) != (expected := ROOT_QPOS + len(body.joints)):
        raise InputError(f"the recording has {found} positions; expected {expected} of the body {name!r}")
    usual = Conditions(body=body)
    return usual.but(**{name: type(value)(recording.attrs[name]) for name, value in usual.flat().items()})


def _dataset(
    planned: PlannedWalk, conditions: Conditions, stride: Stride, title: str, **values: np.ndarray
) -> xr.Dataset:
    """A recording of a plan of one start and `values` by the names of their variables."""
    values |= {
        "time": planned.time,
        "seconds": planned.time / conditions.time.vp,
        "velocity": planned.velocity[:, 0],
        "planned_x": planned.x[:, 0],
        "planned_y": planned.y[:, 0],
        "planned_stance": planned.stance[:, 0],
        "planned_margin": walk_margin(planned)[:, 0],
        "planned_loss_time": loss_time(planned)[0],
    }
    texts = _TIMES | PLANNED | MEASURED
    variables = {
        name: (dimensions, values[name], {"units": units, "long_name": long_name})
        for name, (dimensions, units, long_name) in texts.items()
        if name in values
    }
    coords = {name: variables.pop(name) for name in _TIMES} | {"leg": list(LEGS), "coordinate": list("xyz")}
    return xr.Dataset(variables, coords, {"title": title, **conditions.settings(), **_settings(stride)})


def _settings(stride: Stride) -> dict[str, Any]:
    """A stride in one flat table that NetCDF and JSON can hold."""
    settings = asdict(stride)
    return settings | {name: list(values) for name, values in settings.pop("geometry").items()}


def _lifted_tips(planned: PlannedWalk, conditions: Conditions, stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Planned tips of one start in the root frame after each step, (step, leg, 3), and at time 0, (leg, 3) [mm]."""
    x = planned.x[0] + planned.velocity[0, :, None] * stride.dt  # all legs retract in the first step
    tips = TipTargets(x, conditions, stride).follow(planned, np.array([0]))[0]
    m = conditions.substeps(stride)
    return tips[m - 1 :: m], standing_tips(x[0], conditions.path.standing_height, stride)
