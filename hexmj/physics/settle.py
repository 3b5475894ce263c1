"""Settling: MuJoCo puts each start on its six feet, where it comes to rest before it walks."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.kinematics import standing_tips
from hexmj.bodies.mjcf import check_home, compile_body
from hexmj.body import ROOT_QPOS
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Plan
from hexmj.errors import InputError, OutOfReach, SimulationError
from hexmj.physics.engine import Diverged, MujocoBatch, walk_error
from hexmj.physics.substeps import SINK
from hexmj.starts import checked_starts, draw_starts
from hexmj.timing import Stride

RESTING = 2.0 / 3.0
"""Maximum depth of a foot at rest with adhesion, as a share of the depth that causes fine steps (`substeps.SINK`)."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Starts at rest in MuJoCo, from which walks with any controller and velocity begin."""

    starts: np.ndarray
    """(start, leg) planned tips on their own axes [mm]."""
    tips: np.ndarray
    """(start, leg, 3) planned tips in the root frame [mm]."""
    state: np.ndarray
    """(start, state) positions, velocities and the solver's initial values, as `engine.Engine.put` takes them."""
    ctrl: np.ndarray
    """(start, actuator) joint targets for the planned tips [rad], followed by the feet's adhesion, if any."""
    load: np.ndarray
    """(start, leg) normal force of the ground on each foot, without adhesion [g mm/s^2]."""
    torques: np.ndarray
    """(start, joint) torques of the servos [g mm^2/s^2]."""
    compiled: CompiledBody
    """Body compiled with the time step and the conditions of the walk."""
    conditions: Conditions
    """Conditions of the walk."""
    stride: Stride
    """Stride of the plan."""
    substeps: int
    """Physics steps in one step of the plan."""

    @property
    def qpos(self) -> np.ndarray:
        """(start, position) positions at rest."""
        return self.state[:, : self.compiled.model.nq]


@dataclass(eq=False)
class Settling:
    """Settles starts with one compiled body; earlier calls do not change the bits of the result.

    Raises:
        InputError: posture home does not fit the description of the body.
    """

    conditions: Conditions
    """Conditions of the walk."""
    stride: Stride
    """Stride of the plan."""
    threads: int | None = None
    """Number of threads, by default one per core."""
    pushes: bool = False
    """Whether to measure the forces of the feet on the ground."""

    def __post_init__(self) -> None:
        timestep = self.conditions.timestep(self.stride)
        self._compiled = compile_body(self.conditions, timestep, looks=False, pushes=self.pushes)
        check_home(self._compiled)
        self._batch: MujocoBatch | None = None

    def at(self, x: np.ndarray, names: np.ndarray | None = None, y: np.ndarray | None = None) -> Settled:
        """Return the settled starts.

        Args:
            x: planned tips on their own axes, (start, leg) [mm].
            names: indices of the starts in error messages, (start,), by default their rows.
            y: distances of the tips from the body axis, left positive, (start, leg) [mm]; by default the legs' lines.

        Raises:
            InputError, SimulationError: see `settle`.
        """
        conditions, stride, compiled, batch = self.conditions, self.stride, self._compiled, self._batch
        names = np.arange(len(x)) if names is None else names
        model, columns, height = compiled.model, compiled.columns, conditions.standing_height
        tips = standing_tips(x, height, stride)
        if y is not None:
            tips[..., 1] = y
        joints, reachable = compiled.inverse(tips)
        if not reachable.all():
            start, leg = np.argwhere(~reachable)[0]
            raise OutOfReach(
                f"start {names[start]}, leg {leg + 1}: the tip at {x[start, leg]:.3g} mm is out of reach"
                f" at a standing height of {height:g} mm"
            )
        if batch and len(batch.qpos) == len(x):
            batch.reset()
        else:
            batch = self._batch = MujocoBatch(compiled, len(x), self.threads)
        batch.qpos[:, :ROOT_QPOS] = (0.0, 0.0, height + compiled.foot_radius, 1.0, 0.0, 0.0, 0.0)
        batch.qpos[:, columns.qpos] = joints.reshape(len(x), -1)
        ctrl = np.ones((len(x), model.nu))
        ctrl[:, columns.ctrl] = joints.reshape(len(x), -1)
        try:
            batch.rest(ctrl, max(1, round(conditions.settling_time / 1000.0 / model.opt.timestep)))
        except Diverged as error:
            error.start = int(names[error.start])
            raise walk_error(error, "settling", 0.0) from None
        if conditions.grasp:
            _check_grasp(batch.sensors[:, columns.foot], compiled)
        load = compiled.carried(batch.sensors, batch.force)
        _check_rest(batch, load, names, compiled)
        torques = batch.force[:, columns.ctrl].copy()
        state, substeps = batch.states(np.arange(len(x))), conditions.substeps(stride)
        return Settled(x, tips, state, ctrl, load, torques, compiled, conditions, stride, substeps)


def settle(
    starts: ArrayLike, conditions: Conditions | None = None, stride: Stride | None = None, threads: int | None = None
) -> Settled:
    """Put the insect on its six feet at each start and let it come to rest.

    Args:
        starts: planned tips, (start, leg) [mm].
        conditions: conditions of the walk.
        stride: stride of the plan.
        threads: number of threads, by default one per core.

    Raises:
        InputError: a start is out of reach, posture home does not fit the body, or the adhesion is too strong.
        SimulationError: a start does not settle: it still moves, a foot is off the ground, or the trunk touches it.
    """
    stride = stride or Stride()
    return Settling(conditions or Conditions(), stride, threads).at(checked_starts(starts, stride))


def settle_plan(plan: Plan, conditions: Conditions, threads: int | None = None, pushes: bool = False) -> Settled:
    """Put the insect on the tips at which a plan begins; see `settle`, and `Settling` for `pushes`."""
    return Settling(conditions, plan.stride, threads, pushes).at(plan.starts, y=getattr(plan, "y", None))


def check_adhesion(conditions: Conditions, stride: Stride, seed: int) -> None:
    """Raise InputError if adhesion presses the feet too deep into the ground, at the first start of a seed."""
    if conditions.grasp > 0:
        with suppress(OutOfReach, SimulationError):  # the walk reports these errors
            settle(draw_starts(1, seed, stride), conditions, stride, threads=1)


def _check_rest(batch: MujocoBatch, load: np.ndarray, names: np.ndarray, compiled: CompiledBody) -> None:
    """Raise SimulationError for the first start that is not at rest on its feet."""
    touch, trunk = batch.sensors[:, compiled.columns.touch], batch.sensors[:, compiled.columns.trunk]
    speed, at_rest = np.linalg.norm(batch.qvel[:, :3], axis=1), compiled.conditions.body.lengths.speed_at_rest
    moving = speed[np.argmax(speed > at_rest)]
    for fault, failed in {
        f"it still moves at {moving:.3g} mm/s; expected at most {at_rest:g} mm/s": speed > at_rest,
        "a foot is off the ground": (touch <= 0).any(axis=1),
        "its feet carry less than half of its weight": load.sum(axis=1) < 0.5 * compiled.weight,
        "the trunk is on the ground": (trunk > 0).any(axis=1),
    }.items():
        if failed.any():
            start, duration = names[np.argmax(failed)], compiled.conditions.settling_time
            raise SimulationError(f"start {start} did not settle in {duration:g} ms: {fault}")


def _check_grasp(feet: np.ndarray, compiled: CompiledBody) -> None:
    """Raise InputError if adhesion presses feet at rest, (start, leg * axis) [mm], too deep into the ground.

    Otherwise every step would be a fine step, whose hard contacts would throw the insect off the ground.
    """
    deepest, grasp = compiled.depth(feet.reshape(len(feet), 6, 3)).max(), compiled.conditions.grasp
    allowed = RESTING * SINK * compiled.conditions.standing_height
    if deepest > allowed:
        raise InputError(
            f"grasp = {grasp:g} presses feet {deepest:.3g} mm into the ground at rest (limit: {allowed:.3g} mm);"
            f" expected at most about {grasp * allowed / deepest:.2g}"
        )
