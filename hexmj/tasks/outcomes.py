"""Outcomes of tasks: static margins of simulated walks, and the time of recovery after a push."""

import numpy as np

from hexmj.physics.outcomes import grounded, measured_walk
from hexmj.physics.rollout import Chunk
from hexmj.physics.settle import Settled
from hexmj.stability import walk_margin

NORMAL = 2.0
"""Deviation from the undisturbed walk, in standard deviations of its gait, up to which a walk has recovered, in the
sense of Revzen et al. 2013 (Biol. Cybern. 107, 179)."""


class MarginSoFar:
    """Least and mean stability margin of the feet at the ground until the fall of each start, updated chunk by chunk.

    The margin is normalised by the length of the shortest leg.
    """

    least: np.ndarray
    """(start,) least margin; -inf while no foot is at the ground."""

    def __init__(self, settled: Settled) -> None:
        """Begin without a margin."""
        size = len(settled.starts)
        self._settled, self.least = settled, np.full(size, np.inf)
        self._sum, self._count = np.zeros((2, size))

    @property
    def mean(self) -> np.ndarray:
        """(start,) mean margin over the steps in which at least one foot is at the ground."""
        return np.divide(self._sum, self._count, out=np.full(len(self._sum), np.nan), where=self._count > 0)

    def add(self, chunk: Chunk) -> None:
        """Add one chunk of `rollout.drive`."""
        conditions = self._settled.conditions
        ends = measured_walk(chunk, self._settled)
        margin = walk_margin(grounded(ends.measured, ends.height, conditions), threads=1)
        margin = margin / conditions.body.lengths.shortest_leg
        self.least[chunk.ids] = np.fmin(self.least[chunk.ids], np.fmin.reduce(margin, axis=0, initial=np.inf))
        known = np.isfinite(margin)
        self._sum[chunk.ids] += np.ascontiguousarray(np.where(known, margin, 0.0).T).sum(axis=1)
        self._count[chunk.ids] += known.sum(axis=0)


def recovery_times(pushed: np.ndarray, undisturbed: np.ndarray, step: np.ndarray, dt: float) -> np.ndarray:
    """Return the time from a push until each walk is back in its undisturbed gait.

    Compared are the velocity to the left and the yaw rate of the root, at the same steps of the same plan. A walk has
    recovered when both stay within `NORMAL` standard deviations of its own undisturbed walk.

    Args:
        pushed: x, y [mm] and heading [rad] of the pushed roots, (step, start, 3), NaN after a fall.
        undisturbed: the same walks without the push.
        step: step at which each push begins, (start,).
        dt: duration of a step [time units].

    Returns:
        (start,) [time units]: inf for walks that do not recover before the end; NaN for walks that fall.
    """
    usual = _motion(undisturbed, dt)
    deviation = np.abs(_motion(pushed, dt) - usual)
    limit = NORMAL * np.nanstd(np.ascontiguousarray(usual.transpose(1, 2, 0)), axis=2)
    outside = (deviation > limit).any(axis=2)
    steps = np.arange(1, len(outside) + 1)[:, None]
    last = np.where(outside & (steps > step), steps, step).max(axis=0)
    time = np.where(last == len(outside), np.inf, (last - step) * dt)
    return np.where(np.isnan(deviation[-1]).any(axis=1), np.nan, time)


def _motion(poses: np.ndarray, dt: float) -> np.ndarray:
    """Return velocity to the left [mm / time unit] and yaw rate [rad / time unit] of each step, (step, start, 2)."""
    place, angle = poses[..., 0] + 1j * poses[..., 1], poses[..., 2]
    turned = (np.diff(angle, axis=0) + np.pi) % (2 * np.pi) - np.pi
    sideways = (np.diff(place, axis=0) * np.exp(-1j * angle[:-1])).imag
    return np.stack([sideways, turned], axis=-1) / dt
