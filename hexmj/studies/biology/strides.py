"""The last strides of walks that have found their gait: what the body did at every physics step."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hexmj.controllers.checked_plans import begin
from hexmj.controllers.protocol import Controller
from hexmj.physics.drive import Chunk, drive
from hexmj.physics.settling import Settled

HOP = 0.12
"""A foot that is off the ground for a smaller part of the time from PEP_0 to AEP_0 does not swing."""


@dataclass(frozen=True, eq=False)
class Strides:
    """One start, from one onset of leg 1 to another."""

    count: int
    """Strides."""
    step: float
    """Physics step [s]."""
    hop: float
    """Rows off the ground beyond which a foot swings."""
    qpos: np.ndarray
    """(row, position) before each step."""
    velocity: np.ndarray
    """(row, 3) of the root [mm/s]."""
    turning: np.ndarray
    """(row, joint) velocities of the joints over the step that ends there [rad/s]."""
    torques: np.ndarray
    """(row, joint) of the servos over that step, with their damping as the integrator took it [g mm^2/s^2]."""
    standing: np.ndarray
    """(row, leg)."""
    centre: np.ndarray
    """(row, 3) centre of mass in the world [mm]."""
    every: int
    """Rows from one of `ground` to the next: a step of the plan."""
    ground: np.ndarray
    """(sample, leg, 3) of the ground on the feet, in the world [g mm/s^2]."""

    def lifted(self, leg: int) -> np.ndarray:
        """Rows in which a leg begins to swing, of a walk that repeats itself."""
        rows = len(self.standing)
        found = onsets(np.tile(self.standing[:, leg], 3), self.hop)
        return found[(found >= rows) & (found < 2 * rows)] - rows

    def stances(self, leg: int) -> list[np.ndarray]:
        """Rows of each stance of a leg, from its landing until it leaves the ground for longer than it hops; one that
        the ends of the strides cut is put together of its parts."""
        standing, rows, lifted = self.standing[:, leg], len(self.standing), self.lifted(leg)
        strides = [np.arange(a, b) % rows for a, b in pairwise([*lifted, *(lifted[:1] + rows)])]
        return [stride[standing[stride].argmax() :] for stride in strides]


def last_strides(
    settled: Settled,
    controller: Controller,
    velocity: float,
    duration: float,
    measured: float,
    threads: int | None = None,
) -> Iterator[tuple[int, Strides]]:
    """The whole strides within the last part of every walk, start by start; those that fall have none.

    Args, beside those of `WalkSettings`:
        settled: starts at rest, whose feet's pushes are measured.
        measured: how much of the duration counts [time units].
    """
    plan = begin(controller, settled.starts, velocity, settled.stride, None, threads)
    first = (duration - measured) / settled.stride.dt * settled.substeps
    chunks = [chunk for chunk in drive(settled, plan, duration, threads=threads) if chunk.first >= first]
    walked = chunks[-1].ids[~chunks[-1].fell] if chunks else ()
    hop = rows_of_a_hop(settled)
    for start in walked:
        standing = np.concatenate([chunk.standing[chunk.ids == start][0, :, 0] for chunk in chunks])
        begun = onsets(standing, hop)
        begun = begun[begun > 1]  # not the strides that begin from rest
        if len(begun) > 1:
            yield int(start), strides_between(settled, chunks, start, begun)


def strides_between(settled: Settled, chunks: Sequence[Chunk], start: int, begun: np.ndarray) -> Strides:
    """What a start did from the first to the last of the rows in which strides have `begun`: at least two, none among
    the first two rows of the chunks, which follow each other and show what feet push."""
    columns, h = settled.compiled.columns, settled.compiled.model.opt.timestep
    m, rows = settled.substeps, slice(begun[0], begun[-1])
    qpos, sensors, torque, standing = (
        np.concatenate([getattr(chunk, name)[chunk.ids == start][0] for chunk in chunks])
        for name in ("qpos", "sensors", "torque", "standing")
    )
    moved = np.diff(qpos, axis=0) / h  # row t is the velocity at row t + 1
    return Strides(
        count=len(begun) - 1,
        step=h,
        hop=rows_of_a_hop(settled),
        qpos=qpos[rows],
        velocity=moved[begun[0] - 1 : begun[-1] - 1, :3],
        turning=moved[begun[0] - 1 : begun[-1] - 1, columns.qpos],
        torques=torque[begun[0] - 1 : begun[-1] - 1],
        standing=standing[rows],
        centre=sensors[rows, columns.centre_of_mass],
        every=m,
        ground=-sensors[rows][::m, columns.feet_push].reshape(-1, 6, 3),
    )


def rows_of_a_hop(settled: Settled) -> float:
    """Physics steps off the ground beyond which a foot swings, see `HOP`."""
    stride, step = settled.stride, settled.compiled.model.opt.timestep
    return HOP * (stride.aep0 - stride.pep0) / settled.conditions.vp / step


def onsets(standing: np.ndarray, hop: float) -> np.ndarray:
    """Rows in which a foot, (row,), leaves the ground for longer than it hops."""
    changes = np.flatnonzero(standing[1:] != standing[:-1]) + 1
    lifted = changes[~standing[changes]]
    landed = np.append(changes[standing[changes]], len(standing))
    return lifted[landed[np.searchsorted(landed, lifted)] - lifted > hop]
