"""Recordings: one start of a walk as a file, with all that figures and films need."""

from pathlib import Path

import numpy as np
import xarray as xr

from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS, STICK_INSECT, Body
from hexmj.checks import typed
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.files import read_netcdf, write_netcdf
from hexmj.legs import LEGS
from hexmj.measures.compare import REPORTED
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.orders import hold
from hexmj.replay.schema import MEASURED, PLANNED, TIMES, check_recording, check_settings, stride_settings
from hexmj.rotations import rotated
from hexmj.stability import loss_time, walk_margin
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, one_start


def record(walk: PhysicalWalk, start: int = 0, title: str = "") -> xr.Dataset:
    """What the physical insect did from one start, and what was planned; NaN after a fall.

    What is called planned is the plan on paper, whose loss is the kinematic one; but `planned_tip` is where the tips
    were told to be, which differs where the plan reads the legs.

    Args:
        walk: physical walks kept whole.
        start: which of them.
        title: shown on films.
    """
    typed("walk", walk, PhysicalWalk)
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
    typed("conditions", conditions, Conditions)
    typed("stride", stride, Stride)
    planned = one_start(typed("plan", plan, PlannedWalk), start)
    if plan.geometry != stride.geometry:
        raise InputError(f"the plan's lines are {plan.geometry}; expected those of the stride, {stride.geometry}")
    steps = len(plan.time)
    if not (steps and np.allclose(plan.time, np.arange(1, steps + 1) * stride.dt, 1e-9, 0.0)):
        raise InputError(
            f"the plan's {steps} times are not those of its first steps; expected multiples of {stride.dt}"
        )
    if any(np.isnan(told).any() for told in (planned.x, planned.y, planned.velocity)):
        raise InputError("plan: a walk of which no more is known from a fall on; expected a plan to its end")
    compiled = compile_body(conditions)
    tips, first = _lifted_tips(planned, conditions, stride)
    root = np.zeros((len(plan.time), ROOT_QPOS))
    root[:, 0] = np.cumsum(planned.velocity[:, 0]) * stride.dt
    root[:, 2] = conditions.standing_height + compiled.foot_radius
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
    """Write a recording as NetCDF with a checksum; the file appears whole or not at all.

    Raises:
        InputError: it is no recording, see `check_recording`, or cannot be written.
    """
    _check(typed("recording", recording, xr.Dataset))
    return write_netcdf(recording, path)


def load_recording(path: Path | str) -> xr.Dataset:
    """Read a recording that `save_recording` wrote.

    Raises:
        InputError: it cannot be read, is damaged, or is no recording.
    """
    recording = read_netcdf(path)
    try:
        _check(recording)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return recording


def recorded_conditions(recording: xr.Dataset, body: Body = STICK_INSECT) -> Conditions:
    """The conditions of a recorded walk of a body.

    Raises:
        InputError: one that makes no sense, or the recording is of another body.
    """
    if (name := recording.attrs.get("body")) != body.name:
        raise InputError(f"the recording is of the body {name!r}, not of {body.name!r}; expected its own description")
    if (found := recording.sizes["position"]) != (expected := ROOT_QPOS + len(body.joints)):
        raise InputError(f"the recording has {found} positions; expected {expected} of the body {name!r}")
    check_settings(recording)
    told = {name: type(value)(recording.attrs[name]) for name, value in Conditions().values().items()}
    return Conditions(body=body, **told)


def _check(recording: xr.Dataset) -> None:
    """Refuse what is no recording; conditions as far as the body's bounds are known."""
    check_recording(recording)
    if recording.attrs["body"] == STICK_INSECT.name:
        recorded_conditions(recording)


def _dataset(
    planned: PlannedWalk, conditions: Conditions, stride: Stride, title: str, **values: np.ndarray
) -> xr.Dataset:
    """A recording of a plan of one start and `values` by the names of their variables."""
    typed("title", title, str)
    values |= {
        "time": planned.time,
        "seconds": planned.time / conditions.vp,
        "velocity": planned.velocity[:, 0],
        "planned_x": planned.x[:, 0],
        "planned_y": planned.y[:, 0],
        "planned_stance": planned.stance[:, 0],
        "planned_margin": walk_margin(planned)[:, 0],
        "planned_loss_time": loss_time(planned)[0],
    }
    variables = {
        name: (one.dimensions, values[name], {"units": one.units, "long_name": one.long_name})
        for name, one in (TIMES | PLANNED | MEASURED).items()
        if name in values
    }
    coords = {name: variables.pop(name) for name in TIMES} | {"leg": list(LEGS), "coordinate": list("xyz")}
    return xr.Dataset(variables, coords, {"title": title, **conditions.settings(), **stride_settings(stride)})


def _lifted_tips(planned: PlannedWalk, conditions: Conditions, stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Planned tips of one start in the root frame after each step, (step, leg, 3), and at time 0, (leg, 3) [mm]."""
    x = planned.x[0] + planned.velocity[0, :, None] * stride.dt  # all legs retract in the first step
    tips = TipTargets(x, conditions, stride).follow(planned, np.array([0]))[0]
    m = conditions.substeps(stride)
    return tips[m - 1 :: m], standing_tips(x[0], conditions.standing_height, stride)
