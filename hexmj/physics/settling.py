"""Every start is put on its six feet in MuJoCo and comes to rest before it walks."""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import check_home, compile_body
from hexmj.body import ROOT_QPOS
from hexmj.checks import given
from hexmj.conditions import Conditions
from hexmj.errors import InputError, OutOfReach, SimulationError
from hexmj.physics.backend import STATE, Diverged, MujocoBatch
from hexmj.physics.divergence import walk_error
from hexmj.physics.fine_steps import SINK
from hexmj.physics.foot_path import standing_tips
from hexmj.starts import checked_starts, draw_starts
from hexmj.threads import check_memory
from hexmj.timing import Stride

RESTING = 2.0 / 3.0
"""How much of the depth at which steps are taken finely adhesion may press a foot in at rest; the rest is for walking,
see `docs/exploded_walks.md`."""

KEPT = 120_000
"""Memory that a start takes while it walks, as measured of the stick insect [bytes]."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Starts at rest in MuJoCo; the same for every controller and velocity."""

    starts: np.ndarray
    """(start, leg) planned tips [mm]."""
    state: np.ndarray
    """(start, state) positions, velocities and what the solver goes on from, as `backend.Engine.put` takes it."""
    ctrl: np.ndarray
    """(start, actuator) joint targets of the planned tips [rad], and the feet's adhesion where they grasp."""
    load: np.ndarray
    """(start, leg) force of the ground on each foot along its normal, adhesion taken off [g mm/s^2]."""
    torques: np.ndarray
    """(start, joint) of the servos [g mm^2/s^2]."""
    compiled: CompiledBody
    """With the time step and the conditions of the walk."""
    conditions: Conditions
    stride: Stride

    @property
    def qpos(self) -> np.ndarray:
        """(start, position)."""
        return self.state[:, : self.compiled.model.nq]

    @cached_property
    def substeps(self) -> int:
        """Physics steps in one step of a plan."""
        return self.conditions.substeps(self.stride)

    def saved(self, start: int) -> dict[str, np.ndarray]:
        """What replays one start from here on, see `divergence.replayed`: a step of the plan at rest."""
        model = self.compiled.model
        state = np.split(self.state[start], np.cumsum([model.nq, model.nv]))
        return dict(zip(STATE, state, strict=True)) | {
            "xfrc_applied": np.zeros((model.nbody, 6)),
            "ctrl": self.ctrl[[start]].repeat(self.substeps, axis=0),
            "contact": model.pair_solref[:, 0].copy(),
            "timestep": np.array(model.opt.timestep),
            "substeps": np.array(self.substeps),
        }


class Settling:
    """A body that comes to rest at some starts after others; to the same bits, whatever it did before."""

    def __init__(
        self, conditions: Conditions, stride: Stride, threads: int | None = None, *, pushes: bool = False
    ) -> None:
        """Under some conditions of the walk; `threads` step it, one per core unless given, and `pushes` measures what
        its feet push the ground with.

        Raises:
            InputError: a home that is not as described.
        """
        self._conditions, self._stride, self._threads = conditions, stride, threads
        self._compiled = compile_body(conditions, conditions.timestep(stride), looks=False, pushes=pushes)
        check_home(self._compiled)
        self._batch: MujocoBatch | None = None

    def at(self, starts: ArrayLike, names: np.ndarray | None = None) -> Settled:
        """At every start, (start, leg) [mm]; errors tell which by the numbers in `names`, (start,), or by its row.

        Raises:
            InputError, SimulationError: see `settle`.
        """
        conditions, stride, compiled = self._conditions, self._stride, self._compiled
        height, settling_time = conditions.standing_height, conditions.settling_time
        x = checked_starts(starts, stride)
        names = np.arange(len(x)) if names is None else names
        check_memory(f"{len(x)} starts that walk at once in physics", KEPT * len(x))
        model, columns = compiled.model, compiled.columns
        tips = standing_tips(x, height, stride)
        joints, reachable = compiled.inverse(tips)
        if not reachable.all():
            start, leg = np.argwhere(~reachable)[0]
            raise OutOfReach(
                f"start {names[start]}, leg {leg + 1}: the tip at {x[start, leg]:.3g} mm is out of reach"
                f" at a standing height of {height:g} mm"
            )
        batch = self._begun(len(x))
        batch.qpos[:, :ROOT_QPOS] = (0.0, 0.0, height + compiled.foot_radius, 1.0, 0.0, 0.0, 0.0)
        batch.qpos[:, columns.qpos] = joints.reshape(len(x), -1)
        ctrl = np.ones((len(x), model.nu))
        ctrl[:, columns.ctrl] = joints.reshape(len(x), -1)
        try:
            batch.rest(ctrl, max(1, round(settling_time / 1000.0 / model.opt.timestep)))
        except Diverged as error:
            error.start = int(names[error.start])
            raise walk_error(error, "settling", 0.0, conditions) from None
        if conditions.grasp:
            _check_grasp(batch.sensors[:, columns.foot], compiled)
        touch, trunk = batch.sensors[:, columns.touch], batch.sensors[:, columns.trunk]
        load = compiled.carried(batch.sensors, batch.force)
        speed, at_rest = np.linalg.norm(batch.qvel[:, :3], axis=1), conditions.body.lengths.speed_at_rest
        moving = speed[np.argmax(speed > at_rest)]
        for name, failed in {
            f"it still moves at {moving:.3g} mm/s; expected at most {at_rest:g} mm/s": speed > at_rest,
            "a foot is off the ground": (touch <= 0).any(axis=1),
            "its feet carry less than half of its weight": load.sum(axis=1) < 0.5 * compiled.weight,
            "the trunk is on the ground": (trunk > 0).any(axis=1),
        }.items():
            if failed.any():
                start = names[np.argmax(failed)]
                raise SimulationError(f"start {start} did not settle in {settling_time:g} ms: {name}")
        torques = batch.force[:, columns.ctrl].copy()
        return Settled(x, batch.states(np.arange(len(x))), ctrl, load, torques, compiled, conditions, stride)

    def _begun(self, count: int) -> MujocoBatch:
        """As many bodies that have not moved yet; those of last time, where they were as many."""
        batch = self._batch
        if batch and len(batch.qpos) == count:
            batch.reset()
        else:
            batch = self._batch = MujocoBatch(self._compiled, count, self._threads)
        return batch


def settle(
    starts: ArrayLike, conditions: Conditions | None = None, stride: Stride | None = None, threads: int | None = None
) -> Settled:
    """Put the insect on its six feet at every start and let it come to rest.

    Args:
        starts: planned tips, (start, leg) [mm].
        conditions: of the walk.
        stride: of the plan.
        threads: one per core unless given.

    Raises:
        InputError: a start that the legs cannot reach, a home that is not as described, or more adhesion than the
            contacts can hold.
        SimulationError: a start that does not settle: still moving, a foot off the ground, or the trunk on it.
    """
    conditions, stride = given("conditions", conditions, Conditions), given("stride", stride, Stride)
    return Settling(conditions, stride, threads).at(starts)


def check_adhesion(conditions: Conditions, stride: Stride, seed: int) -> None:
    """Refuse before the work adhesion that presses feet too deep, as the seed's first start at rest shows.

    Raises:
        InputError: it does.
    """
    if conditions.grasp > 0:
        with suppress(OutOfReach, SimulationError):  # whether this start comes to rest is asked where it walks
            settle(draw_starts(1, seed, stride), conditions, stride, threads=1)


def _check_grasp(feet: np.ndarray, compiled: CompiledBody) -> None:
    """Refuse adhesion that presses feet at rest, (start, leg * axis) [mm], deeper into the ground than they may be.

    Every step would be taken finely then, on contacts so hard that they throw the insect off.
    """
    deepest, grasp = compiled.depth(feet.reshape(len(feet), 6, 3)).max(), compiled.conditions.grasp
    allowed = RESTING * SINK * compiled.conditions.standing_height
    if deepest > allowed:
        load = compiled.conditions.load
        raise InputError(
            f"grasp = {grasp:g}; expected at most about {grasp * allowed / deepest:.2g}"
            f"{f' with a load of {load:g}' if load else ''}: it presses feet"
            f" {deepest:.3g} mm into the ground at rest, more than {allowed:.3g} mm"
        )
