"""Recordings: datasets of the walk from one start, with everything that figures, films and pages need."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from hexmj.bodies.kinematics import standing_tips
from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS, STICK_INSECT, Body
from hexmj.command import Command
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.controllers.steered import pace
from hexmj.errors import InputError
from hexmj.files import read_netcdf, write_netcdf
from hexmj.legs import LEGS
from hexmj.measures import tables
from hexmj.measures.compare import REPORTED
from hexmj.measures.kinematic import walk as planned_walk
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.physics.foot_path import TipTargets, hold
from hexmj.progress import progress_bar
from hexmj.replay.table import Recording
from hexmj.rotations import rotated
from hexmj.stability import loss_time, walk_margin
from hexmj.starts import draw_start
from hexmj.timing import Acceleration, Stride, observation_duration
from hexmj.tipping import LossesSoFar, Pendulum
from hexmj.validate import number
from hexmj.walks import PlannedWalk, one_start

_STEP, _LEG, _ONCE = ("step",), ("step", "leg"), ()

TIMES = {
    "time": (_STEP, "time unit", "time, in the unit 1 mm / V_p"),
    "seconds": (_STEP, "s", "time"),
}
"""Coordinate of the steps -> its dimensions, unit and meaning."""

PLANNED = {
    "velocity": (_STEP, "V_p", "commanded velocity V_r during the step"),
    "planned_x": (_LEG, "mm", "planned tip on its own axis"),
    "planned_y": (_LEG, "mm", "planned tip beside the body axis, left positive"),
    "planned_stance": (_LEG, "1", "leg retracts in the plan"),
    "planned_margin": (_STEP, "mm", "stability margin of the plan"),
    "planned_loss_time": (_ONCE, "time unit", "first loss of static stability of the plan, or inf"),
    "dynamic_loss_time": (_ONCE, "time unit", "loss of dynamic stability of the plan, or inf"),
    "planned_tip": ((*_LEG, "coordinate"), "mm", "commanded tip in the world"),
    "qpos": ((*_STEP, "position"), "mm, 1, rad", "root's position and unit quaternion, joint angles"),
    "centre_of_mass": ((*_STEP, "coordinate"), "mm", "centre of mass in the world"),
    "joint_angle": ((*_STEP, "joint"), "rad", "angle of the joint"),
    "tip": ((*_LEG, "coordinate"), "mm", "tip of the leg in the world"),
}
"""Variable of every recording -> its dimensions, unit and meaning."""

MEASURED = {
    "measured_x": (_LEG, "mm", "foot ahead of the centre of mass, from the origin of its axis"),
    "measured_y": (_LEG, "mm", "foot beside the centre of mass, left positive"),
    "measured_stance": (_LEG, "1", "foot carries load"),
    "grounded_stance": (_LEG, "1", "foot is at the ground"),
    "grounded_margin": (_STEP, "mm", "stability margin of the feet at the ground"),
    "grounded_loss_time": (_ONCE, "time unit", "first loss of static stability, feet at the ground, or inf"),
    "carried_loss_time": (_ONCE, "time unit", "first loss of static stability, feet that carry load, or inf"),
    "fall_time": (_ONCE, "time unit", "first contact of the trunk with the ground, or inf"),
    "fall_part": (_ONCE, "1", "part that touched the ground first, from 0 at the front; -1 for none"),
    "clearance": (_ONCE, "mm", "least height of the trunk's lowest point"),
    "tilt": (_ONCE, "rad", "greatest tilt of the trunk"),
    "speed": (_ONCE, "1", "distance walked ahead over distance commanded, until the fall"),
    "slip": (_ONCE, "mm/s", "mean sliding speed of a foot in contact"),
    "tracking": (_ONCE, "mm", "95th percentile of the distance of a foot from its target on the ground"),
    "depth": (_ONCE, "mm", "how deep the deepest foot was in the ground until the fall"),
    "saturation": (_ONCE, "1", "fraction of joints times physics steps at the torque limit"),
    "unreachable": (_ONCE, "1", "tip targets out of reach"),
    "joint_torque": ((*_STEP, "joint"), "mN mm", "torque of the servo on the joint"),
    "ground_force": ((*_LEG, "coordinate"), "mN", "force of the ground on the foot"),
}
"""Further variables of the recording of a physical walk. The recording of a plan has none of them."""

OPTIONAL = ("joint_torque", "ground_force")
"""Variables that only recordings of walks with the option `forces` have."""


@dataclass(frozen=True)
class Start:
    """One walk from a random start."""

    controller: Controller
    velocity: float = 0.3
    """Velocity forward as a fraction of V_p; negative backward."""
    left: float = 0.0
    """Velocity to the left as a fraction of V_p; negative to the right."""
    turn: float = 0.0
    """Yaw rate, counterclockwise seen from above [rad / time unit]."""
    seed: int = 0
    """Seed of the random starts."""
    start: int = 0
    """Number of the start among the random starts of the seed."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    stride: Stride = Stride()
    acceleration: Acceleration | None = None
    conditions: Conditions = Conditions()

    def walk(self, physical: bool, threads: int | None = None) -> Any:
        """Return the `PhysicalWalk` if `physical`, otherwise the `PlannedWalk`."""
        command: Any = Command(number("velocity", self.velocity, -1.0, 1.0), self.left, self.turn)
        straight = command.velocity is not None
        v = self.velocity if straight else pace(command, self.stride)
        time = float(observation_duration(self.observation_time, v, self.stride, self.acceleration))
        settings = draw_start(self.start, self.seed, self.stride), self.controller, v if straight else command, time
        how = {"stride": self.stride, "acceleration": self.acceleration, "threads": threads}
        if not physical:
            return planned_walk(*settings, **how)
        with progress_bar("walking") as progress:
            return physical_walk(*settings, **how, conditions=self.conditions, forces=True, progress=progress)

    def recorded(self, physical: bool, title: str, threads: int | None = None) -> Recording:
        """Return a recording of the physical walk if `physical`, otherwise of the plan."""
        walk = self.walk(physical, threads)
        return record(walk, title=title) if physical else record_plan(walk, self.conditions, self.stride, title=title)

    def settings(self, **controllers: Controller) -> dict[str, Any]:
        """Return the settings with which the walk can be repeated, as plain data."""
        walks = tables.settings(controllers, self.observation_time, 1, self.seed, self.stride, self.acceleration)
        own = {name: getattr(self, name) for name in ("velocity", "left", "turn", "start")}
        return own | walks | {"conditions": self.conditions.settings()}


def record(walk: PhysicalWalk, start: int = 0, title: str = "") -> Recording:
    """Record the physical walk from one start together with its plan. After a fall, poses and measures are NaN.

    The planned variables describe the kinematic walk. Only `planned_tip` holds the tips that were commanded in the
    physical walk; with sensory feedback, these differ from the kinematic tips. Without the option `forces` of
    `physical_walk`, the recording has no joint torques and no ground forces.

    Args:
        walk: physical walks.
        start: index of the recorded start in `walk`.
        title: title of figures and films.

    Returns:
        The variables of `PLANNED` and `MEASURED`, with the title, the conditions and the stride as attributes.
    """
    planned, grounded = one_start(walk.planned, start), one_start(walk.grounded, start)
    qpos, outcomes = walk.qpos[:, start], walk.outcomes
    tips, _ = _lifted_tips(one_start(walk.ordered, start), walk.conditions, walk.stride)
    kept = {"joint_torque": walk.torque, "ground_force": walk.ground_force}
    return _dataset(
        *(planned, walk.conditions, walk.stride, title),
        planned_tip=qpos[:, None, :3] + rotated(qpos[:, None, 3:7], tips),
        **{f"measured_{name}": getattr(walk.measured, name)[:, start] for name in ("x", "y", "stance")},
        grounded_stance=grounded.stance[:, 0],
        grounded_margin=walk_margin(grounded)[:, 0],
        grounded_loss_time=outcomes.grounded_loss[start],
        carried_loss_time=outcomes.carried_loss[start],
        fall_time=outcomes.fall[start],
        **{name: getattr(outcomes, name)[start] for name in ("fall_part", *REPORTED)},
        qpos=qpos,
        centre_of_mass=walk.centre_of_mass[:, start],
        **{name: 1e-3 * values[:, start] for name, values in kept.items() if values is not None},
    )


def record_plan(
    plan: PlannedWalk, conditions: Conditions, stride: Stride, start: int = 0, title: str = ""
) -> Recording:
    """Record the plan of one start, shown by a body that follows it exactly: a puppet, without physics.

    The root moves by the plan at the standing height without tilt, and the joints reach the planned tips. The recorded
    centre of mass is the root, the paper's O. A leg that cannot reach its tip keeps its last angles.

    Args:
        plan: planned walks from their first step on.
        conditions: body, V_p, and the height and timing of lifted feet.
        stride: stride of the plan.
        start: index of the recorded start in `plan`.
        title: title of figures and films.

    Returns:
        The variables of `PLANNED`, with the title, the conditions and the stride as attributes.

    Raises:
        InputError: the plan does not begin with its first step, or a leg cannot reach its tip at time 0.
    """
    planned, steps = one_start(plan, start), len(plan.time)
    if steps == 0 or not np.allclose(plan.time, np.arange(1, steps + 1) * stride.dt, 1e-9, 0.0):
        raise InputError(f"plan: its {steps} times are wrong; expected {stride.dt:g}, {2 * stride.dt:g}, ...")
    compiled = compile_body(conditions)
    tips, first = _lifted_tips(planned, conditions, stride)
    root = np.zeros((steps, ROOT_QPOS))
    turn = planned.turn[:, 0] * stride.dt
    angle = np.cumsum(turn)
    way = np.cumsum((planned.velocity[:, 0] + 1j * planned.left[:, 0]) * np.exp(1j * (angle - turn / 2))) * stride.dt
    root[:, 0], root[:, 1], root[:, 2] = way.real, way.imag, conditions.standing_height + compiled.foot_radius
    root[:, 3], root[:, 6] = np.cos(angle / 2), np.sin(angle / 2)
    joints, reachable = compiled.inverse(tips)
    standing, stands = compiled.inverse(first)
    if not stands.all():
        leg = int(np.argmin(stands))
        raise InputError(f"plan: leg {LEGS[leg]} cannot reach its tip at time 0, {first[leg].round(3).tolist()} mm")
    if not reachable.all():
        hold(joints, standing)
    pose = {"qpos": np.concatenate([root, joints.reshape(steps, -1)], axis=1), "centre_of_mass": root[:, :3]}
    tips = root[:, None, :3] + rotated(root[:, None, 3:7], tips)
    return _dataset(planned, conditions, stride, title, planned_tip=tips, **pose)


def save_recording(recording: xr.Dataset, path: Path | str) -> Path:
    """Write a recording as NetCDF.

    Raises:
        InputError: the dataset is not a recording, or cannot be written.
    """
    check_recording(recording)
    return write_netcdf(recording, path)


def load_recording(path: Path | str) -> Recording:
    """Read a recording that `save_recording` wrote.

    Raises:
        InputError: the file cannot be read or is not a recording.
    """
    loaded = read_netcdf(path)
    check_recording(loaded, f"{path}: ")
    return Recording(loaded.data_vars, loaded.coords, loaded.attrs)


def check_recording(recording: xr.Dataset, where: str = "") -> None:
    """Raise InputError if a variable or an attribute of a recording is missing."""
    physical = not MEASURED.keys().isdisjoint(recording.variables)
    needed = [*TIMES, *PLANNED, *(MEASURED if physical else ()), "title", *Conditions().settings()]
    missing = [name for name in needed if name not in {*recording.variables, *recording.attrs, *OPTIONAL}]
    if missing:
        raise InputError(f"{where}not a recording, which `hexmj walk` and `hexmj.record` make; it lacks {missing[0]}")


def recorded_conditions(recording: xr.Dataset, body: Body = STICK_INSECT) -> Conditions:
    """Return the conditions of a recorded walk.

    Args:
        recording: recording of a walk.
        body: description of the recorded body.

    Raises:
        InputError: the recording is of another body, or has values that the body does not allow.
    """
    name, positions = recording.attrs["body"], recording.sizes["position"]
    if (name, positions) != (body.name, expected := ROOT_QPOS + len(body.joints)):
        raise InputError(
            f"the recording is of the body {name!r} with {positions} positions; expected {body.name!r}"
            f" with {expected}. Pass the description of the recorded body as `body`."
        )
    defaults = Conditions().values()
    return Conditions(body=body, **{name: type(value)(recording.attrs[name]) for name, value in defaults.items()})


def recording_summary(recording: xr.Dataset) -> dict[str, float]:
    """Return the variables of a recording that are one number: times of losses and outcomes of the walk."""
    return {str(name): values.item() for name, values in recording.data_vars.items() if not values.dims}


def _stride_settings(stride: Stride) -> dict[str, Any]:
    """Return the fields of a stride and of its geometry as attributes without nesting."""
    settings = asdict(stride)
    return settings | {name: list(values) for name, values in settings.pop("geometry").items()}


def _dataset(planned: PlannedWalk, conditions: Conditions, stride: Stride, title: str, **values: Any) -> Recording:
    """Build a recording from the plan of one start; `values` gives the other variables by name."""
    margin, pendulum = walk_margin(planned), Pendulum.of(conditions.standing_height, conditions.seconds(stride))
    so_far = LossesSoFar(pendulum, 1)
    so_far.add(margin, np.array([len(margin)]))
    tipped = so_far.losses.dynamic[0]
    values |= {
        "time": planned.time,
        "seconds": planned.time / conditions.vp,
        "velocity": planned.velocity[:, 0],
        **{f"planned_{name}": getattr(planned, name)[:, 0] for name in ("x", "y", "stance")},
        "planned_margin": margin[:, 0],
        "planned_loss_time": loss_time(planned)[0],
        "dynamic_loss_time": tipped * stride.dt if tipped else np.inf,
    }
    qpos = values["qpos"]
    values["joint_angle"] = angles = qpos[:, ROOT_QPOS:]
    tips = compile_body(conditions).forward(angles.reshape(len(qpos), len(LEGS), -1))
    values["tip"] = qpos[:, None, :3] + rotated(qpos[:, None, 3:ROOT_QPOS], tips)
    axes = {"leg": list(LEGS), "coordinate": list("xyz"), "joint": list(conditions.body.joints)}
    attributes = {"title": title, **conditions.settings(), **_stride_settings(stride)}
    return Recording(_filled(PLANNED | MEASURED, values), _filled(TIMES, values) | axes, attributes)


def _filled(table: dict[str, tuple], values: dict[str, np.ndarray]) -> dict[str, tuple]:
    """Return the variables of a table that are in `values`, with unit and meaning as attributes."""
    return {
        name: (dimensions, values[name], {"units": units, "long_name": long_name})
        for name, (dimensions, units, long_name) in table.items()
        if name in values
    }


def _lifted_tips(planned: PlannedWalk, conditions: Conditions, stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Return planned tips of one start in the root frame after each step, (step, leg, 3), and at 0, (leg, 3) [mm]."""
    ahead, left, turn = (values[0, :, None] for values in (planned.velocity, planned.left, planned.turn))
    x = planned.x[0] + ahead * stride.dt - turn * stride.dt * planned.y[0]  # all legs retract in the first step
    y = planned.y[0] + left * stride.dt + turn * stride.dt * (planned.x[0] + np.array(stride.geometry.origin))
    tips = TipTargets(x, conditions, stride, y).follow(planned, np.array([0]))[0]
    m, first = conditions.substeps(stride), standing_tips(x[0], conditions.standing_height, stride)
    first[:, 1] = y[0]
    return tips[m - 1 :: m], first
