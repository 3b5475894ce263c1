"""Observations, rewards and falls of all insects.

They are computed in compiled loops, because a dozen calls of NumPy take as long as the physics of one insect. A test
compares them with the same formulas in plain NumPy (`tests/plain_observations.py`).
"""

from typing import Any

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.environments.task import Task, observation_bounds
from hexmj.jitted import jitted
from hexmj.stability import margins


class Observer:
    """Computes the observations of insects with the same body and task."""

    def __init__(self, compiled: CompiledBody, task: Task) -> None:
        """Prepare bounds and layout of the observations, which `task` describes."""
        bounds, columns = observation_bounds(compiled, task), compiled.columns
        self._bounds = tuple(np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1))
        self._trunk, no_foot = compiled.trunk_corners, compiled.body.lengths.no_foot_margin
        self._layout = compiled.joints, columns.foot.start, columns.centre_of_mass.start, task.command, no_foot
        ends = np.cumsum([low.size for low, _ in bounds.values()]).tolist()
        self._fields = [
            (name, (..., slice(end - low.size, end)), low.shape if low.ndim > 1 else ())
            for (name, (low, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def observe(self, state: tuple[Any, ...], standing: np.ndarray, planned: tuple[Any, ...]) -> np.ndarray:
        """Return the observations of n insects as flat vectors, (n, number); see `write_observations`."""
        flat = np.empty((len(standing), len(self._bounds[0])))
        write_observations(state, standing, planned, self._trunk, self._bounds, self._layout, flat)
        return flat

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return flat observations, (..., number), as arrays by name, each in its own shape."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }


@jitted
def next_targets(actions: Any, ids: Any, scale: Any, ahead: Any, planned: Any, offset: bool) -> Any:
    """Return the joint targets [rad] or tip targets [mm] of n insects in the next step, (n, substep, number).

    Args:
        actions: actions of all insects, (insect, number).
        ids: indices of the insects that walk, (n,).
        scale: joint targets or tip offsets of the action 0, and their changes per unit of a negative and of a positive
            action, each (number,).
        ahead: planned tips of all insects, (insect, step, substep, leg, axis), stance, (insect, step, leg), and the
            index of the next step, (insect,), which this function increments.
        planned: `Walkers.planned`, which this function updates.
        offset: whether the actions are offsets to the planned tips.
    """
    (default, below, above), (tips_ahead, stance_ahead, following), (stance, tips, missed) = scale, ahead, planned
    targets = np.empty((len(ids), tips_ahead.shape[2], actions.shape[1]))
    for i, n in enumerate(ids):
        path = tips_ahead[n, following[n]]
        for leg in range(6):
            stance[n, leg], missed[n, leg] = stance_ahead[n, following[n], leg], 0.0
            for axis in range(3):
                tips[n, leg, axis] = path[-1, leg, axis]
        for j in range(actions.shape[1]):
            value = default[j] + actions[n, j] * (above[j] if actions[n, j] > 0 else below[j])
            for sub in range(len(targets[i])):
                targets[i, sub, j] = path[sub, j // 3, j % 3] + value if offset else value
        following[n] += 1
    return targets


@jitted
def write_observations(
    state: Any, standing: Any, planned: Any, trunk: Any, bounds: Any, layout: Any, flat: Any
) -> None:
    """Write the observations of n insects into `flat`, (n, number), in the order of `task.observation_bounds`.

    Args:
        state: positions, velocities, rotations from the root frames to the world and sensors, see `Walkers.state`.
        standing: whether each foot stands on the ground, (n, leg).
        planned: `Walkers.planned` of the insects.
        trunk: corners of the trunk in the root frame, (corner, axis), and their radii, (corner,) [mm].
        bounds: smallest and largest allowed value of every number, each (number,).
        layout: number of joints, first sensor columns of feet and of the centre of mass, commanded velocity [mm/s],
            and the margin [mm] that is observed if no foot is in contact.
        flat: array to write.
    """
    (qpos, qvel, rotation, sensors), (stance, tips, missed) = state, planned
    (corners, radii), (low, high) = trunk, bounds
    joints, foot, centre, command, no_foot = layout
    around, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(flat)):
        q, v, turn, s, seen = qpos[n], qvel[n], rotation[n], sensors[n], flat[n]
        for j in range(joints):
            seen[j], seen[joints + j] = q[ROOT_QPOS + j], v[ROOT_QVEL + j]
        at = 2 * joints
        for k in range(4):
            seen[at + k] = q[3 + k]
        angle = np.arctan2(turn[1, 0], turn[0, 0])
        cosine, sine = np.cos(angle), np.sin(angle)
        seen[at + 4], seen[at + 5], seen[at + 6] = cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0], v[2]
        for k in range(3):
            seen[at + 7 + k] = v[3 + k]
        seen[at + 10] = np.inf
        for c in range(len(corners)):
            x, y, z = corners[c]
            up = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
            seen[at + 10] = min(seen[at + 10], q[2] + up - radii[c])
        at += 11
        for leg in range(6):
            for k in range(3):
                seen[at + 3 * leg + k] = 0.0
                for axis in range(3):
                    seen[at + 3 * leg + k] += (s[foot + 3 * leg + axis] - q[axis]) * turn[axis, k]
            for axis in range(2):
                around[0, leg, axis] = s[foot + 3 * leg + axis] - s[centre + axis]
            seen[at + 18 + leg], seen[at + 26 + leg] = standing[n, leg], stance[n, leg]
            for k in range(3):
                seen[at + 32 + 3 * leg + k] = tips[n, leg, k]
            if len(seen) > at + 50:
                seen[at + 50 + leg] = missed[n, leg]
        margins(around, standing[n : n + 1], margin)
        seen[at + 24], seen[at + 25] = max(margin[0], no_foot), command
        for i in range(len(seen)):
            seen[i] = min(max(seen[i], low[i]), high[i])


@jitted
def end_step(ids: Any, shown: Any, state: Any, trunk: Any, command: float, time: Any, result: Any) -> bool:
    """Compute the rewards of insects that took a step, and which of their episodes it ended.

    Args:
        ids: indices of the insects that took the step, (n,).
        shown: their sensor values at the beginning of each substep, (n, substep, column).
        state: state of all insects after the step, see `Walkers.state`.
        trunk: first sensor column of the trunk's contacts, and the column after the last.
        command: commanded velocity [mm/s].
        time: steps taken in each episode, (insect,), which this function increments, and the steps of an episode.
        result: `walkers.Acted` of zeros, into which this function writes.

    Returns:
        Whether any episode has ended.
    """
    (_, qvel, rotation, sensors), (done, last), (reward, fell, over) = state, time, result
    ended = False
    for i, n in enumerate(ids):
        done[n] += 1
        for column in range(trunk[0], trunk[1]):
            fell[n] |= sensors[n, column] > 0
            for t in range(shown.shape[1]):
                fell[n] |= shown[i, t, column] > 0
        over[n] = done[n] == last and not fell[n]
        if not fell[n]:
            tracking = max(1.0 - abs(qvel[n, 0] - command) / command, 0.0)
            reward[n] = tracking * max(rotation[n, 2, 2], 0.0)
        ended |= fell[n] or over[n]
    return ended
