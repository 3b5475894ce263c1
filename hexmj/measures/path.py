"""How well walks follow a command: distance to the commanded path, heading error and achieved twist."""

from dataclasses import dataclass

import numpy as np

from hexmj.command import Command
from hexmj.physics.rollout import Chunk
from hexmj.physics.settle import Settled
from hexmj.rotations import heading


@dataclass(frozen=True, eq=False)
class PathOutcomes:
    """How each start follows its command until it falls, or to the end of the walk."""

    path_distance: np.ndarray
    """(start,) root-mean-square distance of the root to the commanded path [mm]."""
    path_length: np.ndarray
    """(start,) length of the commanded path [mm]."""
    heading_error: np.ndarray
    """(start,) heading at the end minus the commanded heading at this time [rad]."""
    forward: np.ndarray
    """(start,) mean velocity forward in the frame of the root, as a fraction of V_p."""
    left: np.ndarray
    """(start,) mean velocity to the left in the frame of the root, as a fraction of V_p."""
    turn: np.ndarray
    """(start,) mean yaw rate [rad / time unit]."""
    way: np.ndarray
    """(start,) distance in the commanded direction, which turns with the root [mm]."""


class PathSoFar:
    """Stores the poses of the roots at the ends of the plan's steps, chunk by chunk."""

    def __init__(self, settled: Settled, steps: int) -> None:
        """Begin with the roots at rest; `steps` is the number of plan steps of the walk."""
        self._m, self._dt = settled.substeps, settled.stride.dt
        self.poses = np.full((steps + 1, len(settled.starts), 3), np.nan)
        """x, y [mm] and heading [rad] of the roots from time 0 on, (step, start, 3); NaN after a fall."""
        self.poses[0] = poses_of(settled.state[:, :7])

    def add(self, chunk: Chunk) -> None:
        """Add one chunk of `rollout.drive`."""
        substep = np.arange(chunk.qpos.shape[1])
        ends = substep[((chunk.first + substep) % self._m == 0) & (chunk.first + substep > 0)]
        poses = poses_of(chunk.qpos[:, ends, :7])
        poses[ends >= chunk.valid[:, None]] = np.nan
        self.poses[np.ix_((chunk.first + ends) // self._m, chunk.ids)] = poses.swapaxes(0, 1)

    def outcomes(self, command: Command) -> PathOutcomes:
        """Return the outcomes of walks by one command."""
        return path_outcomes(self.poses, np.arange(len(self.poses)) * self._dt, command)


def path_outcomes(poses: np.ndarray, time: np.ndarray, command: Command) -> PathOutcomes:
    """Return how walks follow a command.

    Args:
        poses: x, y [mm] and heading [rad] of the root in the world, (step, start, 3), from time 0 on; NaN after a fall.
        time: times of the poses, (step,) [time units].
        command: command of all starts.
    """
    from scipy.spatial import cKDTree

    path = command.path(time)
    ways = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    poses = np.ascontiguousarray(poses.swapaxes(0, 1))  # with steps last, sums do not depend on the other starts
    known = np.isfinite(poses[..., 0])
    last, each = known.sum(axis=1) - 1, np.arange(len(poses))
    place, angle = poses[..., 0] + 1j * poses[..., 1], np.unwrap(np.where(known, poses[..., 2], 0.0), axis=1)
    moved = (place - place[:, :1]) * np.exp(-1j * angle[:, :1])
    away, _ = cKDTree(path[:, :2]).query(np.nan_to_num(np.stack([moved.real, moved.imag], axis=-1)))
    moved = np.diff(place, axis=1) * np.exp(-0.5j * (angle[:, :-1] + angle[:, 1:]))
    ahead = np.nansum(moved, axis=1)
    forward, left, _ = command.parts[np.searchsorted(command.times, time[:-1], side="right") - 1].T
    speed = np.hypot(forward, left)
    aim = np.divide(forward + 1j * left, speed, out=np.zeros(len(speed), complex), where=speed > 0)
    duration = np.maximum(time[last], time[1])
    return PathOutcomes(
        path_distance=np.sqrt((away**2 * known).sum(axis=1) / known.sum(axis=1)),
        path_length=ways[last],
        heading_error=angle[each, last] - angle[:, 0] - path[last, 2],
        forward=ahead.real / duration,
        left=ahead.imag / duration,
        turn=(angle[each, last] - angle[:, 0]) / duration,
        way=np.nansum((moved * aim.conj()).real, axis=1),
    )


def poses_of(root: np.ndarray) -> np.ndarray:
    """Return x, y and heading, (..., 3), of roots with positions and quaternions, (..., 7)."""
    return np.concatenate([root[..., :2], heading(root[..., 3:7])[..., None]], axis=-1)
