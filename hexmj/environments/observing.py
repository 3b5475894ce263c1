"""Tip targets, observations and rewards of all insects, in compiled loops.

The loops are compiled because a dozen calls of NumPy take as long as the physics of one insect. A test compares them
with the same formulas in plain NumPy (`tests/plain_observations.py`).
"""

from typing import Any, NamedTuple

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.environments.task import Task, observation_bounds
from hexmj.jitted import jitted
from hexmj.stability import margins


class Places(NamedTuple):
    """Current states of n insects: positions, velocities, root rotations and sensors."""

    qpos: np.ndarray
    """MuJoCo's qpos, (n, position)."""
    qvel: np.ndarray
    """MuJoCo's qvel, (n, velocity)."""
    rotation: np.ndarray
    """Rotations from the root frames to the world, (n, axis, axis)."""
    sensors: np.ndarray
    """Sensor values, (n, column); only sensors of MuJoCo's position stage are current."""


class Planned(NamedTuple):
    """Planned stance and tips of n insects at the current step, and their targets out of reach."""

    stance: np.ndarray
    """1 for legs that the plan puts in stance, else 0; (n, leg)."""
    tips: np.ndarray
    """Planned tips in the root frame, without the offsets of the action, (n, leg, axis) [mm]."""
    missed: np.ndarray
    """Number of substeps of the last step in which the tip target was out of reach, (n, leg)."""


class Observer:
    """Computes the observations of insects with the same body and task."""

    def __init__(self, compiled: CompiledBody, task: Task) -> None:
        """Prepare bounds and layout of the observations, which `task` describes."""
        bounds, columns = observation_bounds(compiled, task), compiled.columns
        self._bounds = np.array([np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1)])
        self._corners, no_foot = compiled.trunk_corners, compiled.body.lengths.no_foot_margin
        self._layout = compiled.joints, columns.foot.start, columns.centre_of_mass.start, task.command, no_foot
        ends = np.cumsum([low.size for low, _ in bounds.values()]).tolist()
        self._fields = [
            (name, (..., slice(end - low.size, end)), low.shape if low.ndim > 1 else ())
            for (name, (low, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def observe(self, places: tuple[Any, ...], standing: np.ndarray, planned: tuple[Any, ...]) -> np.ndarray:
        """Return the observations of n insects as flat vectors, (n, number).

        Args:
            places: `Places` as a plain tuple, which compiled code receives faster.
            standing: whether each foot stands on the ground, (n, leg).
            planned: `Planned` as a plain tuple.
        """
        flat = np.empty((len(standing), self._bounds.shape[1]))
        write_observations(places, self._corners, standing, planned, self._bounds, self._layout, flat)
        return flat

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return flat observations, (..., number), as arrays by name, each in its own shape."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }


@jitted
def scaled(actions: Any, ids: Any, default: Any, below: Any, above: Any) -> Any:
    """Return the joint targets [rad] or tip offsets [mm], (n, number), of normalised actions, (insect, number)."""
    values = np.empty((len(ids), actions.shape[1]))
    for i, n in enumerate(ids):
        for j in range(values.shape[1]):
            values[i, j] = default[j] + actions[n, j] * (above[j] if actions[n, j] > 0 else below[j])
    return values


@jitted
def next_targets(actions: Any, ids: Any, ahead: Any, planned: Any, offset: bool) -> Any:
    """Return the tip targets of n insects for the next step, in the root frame, (n, substep, leg, axis) [mm].

    Args:
        actions: joint targets [rad] or tip offsets [mm], (n, number).
        ids: indices of the insects, (n,).
        ahead: of all insects, planned tips (insect, step, substep, leg, axis), stance (insect, step, leg), and the
            index of the next step, (insect,), which this function increments.
        planned: `Planned` of all insects, which this function updates.
        offset: whether the actions are tip offsets, which are then added to the planned tips.
    """
    tips_ahead, stance_ahead, at = ahead
    tips = np.empty((len(ids), tips_ahead.shape[2], 6, 3))
    for i, n in enumerate(ids):
        for leg in range(6):
            planned[0][n, leg], planned[2][n, leg] = stance_ahead[n, at[n], leg], 0.0
            for axis in range(3):
                for sub in range(tips.shape[1]):
                    tips[i, sub, leg, axis] = tips_ahead[n, at[n], sub, leg, axis]
                    planned[1][n, leg, axis] = tips[i, sub, leg, axis]
                    tips[i, sub, leg, axis] += actions[i, 3 * leg + axis] if offset else 0.0
        at[n] += 1
    return tips


@jitted
def write_observations(
    places: Any, corners: Any, standing: Any, planned: Any, bounds: Any, layout: Any, flat: Any
) -> None:
    """Write the observations of n insects into `flat`, (n, number), in the order of `task.observation_bounds`.

    Args:
        places: `Places` of the insects.
        corners: corners of the trunk in the root frame, (corner, axis), and their radii, (corner,) [mm].
        standing: whether each foot stands on the ground, (n, leg).
        planned: `Planned` of the insects.
        bounds: smallest and largest allowed value of every number, (2, number).
        layout: number of joints, first sensor columns of feet and of the centre of mass, commanded velocity [mm/s],
            and the margin [mm] that is observed if no foot is in contact.
    """
    joints, foot, centre, command, no_foot = layout
    around, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(flat)):
        q, v, turn, s, seen = places[0][n], places[1][n], places[2][n], places[3][n], flat[n]
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
        for c in range(len(corners[0])):
            x, y, z = corners[0][c]
            up = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
            seen[at + 10] = min(seen[at + 10], q[2] + up - corners[1][c])
        at += 11
        for leg in range(6):
            for k in range(3):
                seen[at + 3 * leg + k] = 0.0
                for axis in range(3):
                    seen[at + 3 * leg + k] += (s[foot + 3 * leg + axis] - q[axis]) * turn[axis, k]
            for axis in range(2):
                around[0, leg, axis] = s[foot + 3 * leg + axis] - s[centre + axis]
            seen[at + 18 + leg], seen[at + 26 + leg] = standing[n, leg], planned[0][n, leg]
            for k in range(3):
                seen[at + 32 + 3 * leg + k] = planned[1][n, leg, k]
            if len(seen) > at + 50:
                seen[at + 50 + leg] = planned[2][n, leg]
        margins(around, standing[n : n + 1], margin)
        seen[at + 24], seen[at + 25] = max(margin[0], no_foot), command
        for i in range(len(seen)):
            seen[i] = min(max(seen[i], bounds[0, i]), bounds[1, i])


@jitted
def end_step(places: Any, ids: Any, sensors: Any, trunk: Any, command: float, time: Any, result: Any) -> bool:
    """Compute the rewards of insects that took a step, and which of their episodes it ended.

    Args:
        places: `Places` of all insects after the step.
        ids: indices of the insects that took the step, (n,).
        sensors: sensor values at the beginning of each substep, (n, substep, column).
        trunk: first sensor column of the trunk's contacts, and the column after the last.
        command: commanded velocity [mm/s].
        time: steps taken in each episode, (insect,), which this function increments, and the steps of an episode.
        result: rewards, falls and reached time limits, each (insect,); zeros, into which this function writes.

    Returns:
        Whether any episode has ended.
    """
    (_, qvel, rotation, now), (done, steps), (reward, fell, over), ended = places, time, result, False
    for i, n in enumerate(ids):
        done[n] += 1
        for column in range(trunk[0], trunk[1]):
            fell[n] |= now[n, column] > 0
            for t in range(sensors.shape[1]):
                fell[n] |= sensors[i, t, column] > 0
        over[n] = done[n] == steps and not fell[n]
        if not fell[n]:
            reward[n] = step_reward(qvel[n], rotation[n], command)
        ended |= fell[n] or over[n]
    return ended


@jitted
def step_reward(qvel: Any, rotation: Any, command: float) -> float:
    """Return the reward of a step without a fall, from the state after the step; `task` explains the formula."""
    return max(1.0 - abs(qvel[0] - command) / command, 0.0) * max(rotation[2, 2], 0.0)
