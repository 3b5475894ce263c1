"""Observations and rewards of all insects at once.

`tests/plain_observations.py` has the same formulas in plain NumPy, and a test compares the two.
"""

from typing import Any, NamedTuple

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.environments.task import Task, observation_bounds
from hexmj.jitted import jitted
from hexmj.stability import margins


class Places(NamedTuple):
    """The state of some insects now."""

    qpos: np.ndarray
    """(n, position)."""
    qvel: np.ndarray
    """(n, velocity)."""
    rotation: np.ndarray
    """From the root frames to the world, (n, axis, axis)."""
    sensors: np.ndarray
    """(n, column); the columns that measure places are current."""


class Planned(NamedTuple):
    """The plans of some insects now."""

    stance: np.ndarray
    """Legs that may stand, (n, leg) of 0 and 1."""
    tips: np.ndarray
    """Tips in the root frame, without offsets, (n, leg, axis) [mm]."""
    missed: np.ndarray
    """Substeps of the last step in which a tip was out of reach, (n, leg)."""


class Observer:
    """Observes insects of one body in one task."""

    def __init__(self, compiled: CompiledBody, task: Task) -> None:
        """Prepare the layout of the observations, which `task` describes."""
        self._compiled, self._command, self._no_foot = compiled, task.command, compiled.body.lengths.no_foot_margin
        bounds = observation_bounds(compiled, task)
        self._low, self._high = (np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1))
        ends = np.cumsum([low.size for low, _ in bounds.values()]).tolist()
        self._fields = [
            (name, (..., slice(end - low.size, end)), low.shape if low.ndim > 1 else ())
            for (name, (low, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def observe(self, places: Places, standing: np.ndarray, planned: Planned) -> np.ndarray:
        """Return all observations of some insects, (n, number); `standing` are feet that stand, (n, leg)."""
        (qpos, qvel, *_), count, columns = places, len(standing), self._compiled.columns
        relative = np.empty((count, 24))
        where = columns.foot.start, columns.centre_of_mass.start
        measure(tuple(places), standing, *self._compiled.trunk_corners, where, relative)
        relative[:, 22], relative[:, 23] = np.maximum(relative[:, 22], self._no_foot), self._command
        parts = (
            qpos[:, columns.qpos], qvel[:, columns.qvel], qpos[:, 3:ROOT_QPOS], relative[:, :3], qvel[:, 3:ROOT_QVEL],
            relative[:, 3:22], standing, relative[:, 22:], planned.stance, planned.tips.reshape(count, 18),
            planned.missed,
        )  # fmt: skip
        flat = np.concatenate(parts, axis=1)[:, : len(self._low)]
        return np.minimum(np.maximum(flat, self._low), self._high)

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return observations, (..., number), by name and in their shapes."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }


@jitted
def measure(places: Any, standing: Any, corners: Any, radii: Any, columns: Any, relative: Any) -> None:
    """Measure velocity along the heading, clearance, tips in the root frame, and stability margin.

    Args:
        places: `Places` of the insects.
        standing: feet that stand, (n, leg).
        corners: of the trunk in the root frame, (corner, axis) [mm].
        radii: of the trunk at its corners, (corner,) [mm].
        columns: first sensor columns of feet and centre of mass.
        relative: filled in this order, (n, 3 + 1 + leg * axis + 1 or more).
    """
    (qpos, qvel, rotation, sensors), (foot, centre) = places, columns
    around, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(relative)):
        seen, turn, v, s = relative[n], rotation[n], qvel[n], sensors[n]
        angle = np.arctan2(turn[1, 0], turn[0, 0])
        cosine, sine = np.cos(angle), np.sin(angle)
        seen[0], seen[1], seen[2] = cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0], v[2]
        seen[3] = np.inf
        for c in range(len(corners)):
            up = turn[2, 0] * corners[c, 0] + turn[2, 1] * corners[c, 1] + turn[2, 2] * corners[c, 2]
            seen[3] = min(seen[3], qpos[n, 2] + up - radii[c])
        for leg in range(6):
            for k in range(3):
                seen[4 + 3 * leg + k] = 0.0
                for axis in range(3):
                    seen[4 + 3 * leg + k] += (s[foot + 3 * leg + axis] - qpos[n, axis]) * turn[axis, k]
            for axis in range(2):
                around[0, leg, axis] = s[foot + 3 * leg + axis] - s[centre + axis]
        margins(around, standing[n : n + 1], margin)
        seen[22] = margin[0]


@jitted
def judge(ids: Any, sensors: Any, places: Any, trunk: Any, command: float, reward: Any, fell: Any) -> None:
    """Compute rewards and falls of the insects that took a step.

    Args:
        ids: insects that took the step, (n,).
        sensors: at the beginning of each substep, (n, substep, column).
        places: `Places` of all insects after the step.
        trunk: first column of the contacts of the trunk's parts, and the one after the last.
        command: commanded velocity [mm/s].
        reward: filled for these insects, (insect,).
        fell: filled for these insects, (insect,).
    """
    _, qvel, rotation, now = places
    for i, n in enumerate(ids):
        fell[n] = (now[n, trunk[0] : trunk[1]] > 0).any() or (sensors[i, :, trunk[0] : trunk[1]] > 0).any()
        reward[n] = 0.0 if fell[n] else worth(qvel[n], rotation[n], command)


@jitted
def worth(qvel: Any, rotation: Any, command: float) -> float:
    """Return the reward of a step without a fall, max(0, 1 - |v - c| / c) max(0, u), of one insect in its state now."""
    return max(1.0 - abs(qvel[0] - command) / command, 0.0) * max(rotation[2, 2], 0.0)
