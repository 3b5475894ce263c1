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
        self._compiled, self._command = compiled, task.command
        bounds = observation_bounds(compiled, task)
        self._low, self._high = (np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1))
        ends = np.cumsum([low.size for low, _ in bounds.values()]).tolist()
        self._fields = [
            (name, (..., slice(end - low.size, end)), low.shape if low.ndim > 1 else ())
            for (name, (low, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def observe(self, places: Places, standing: np.ndarray, planned: Planned) -> np.ndarray:
        """Return all observations of some insects, (n, number); `standing` are feet that stand, (n, leg)."""
        qpos, qvel, rotation, sensors = places
        count, columns, lengths = len(standing), self._compiled.columns, self._compiled.body.lengths
        feet = sensors[:, columns.foot].reshape(count, 6, 3)
        margin, relative = np.empty(count), np.empty((count, 22))
        margins(feet[:, :, :2] - sensors[:, np.newaxis, columns.centre_of_mass][:, :, :2], standing, margin)
        measure(qpos, qvel, rotation, feet, *self._compiled.trunk_corners, relative)
        parts = (
            qpos[:, columns.qpos], qvel[:, columns.qvel], qpos[:, 3:ROOT_QPOS], relative[:, :3], qvel[:, 3:ROOT_QVEL],
            relative[:, 3:], standing, np.maximum(margin, lengths.no_foot_margin)[:, np.newaxis],
            np.full((count, 1), self._command), planned.stance, planned.tips.reshape(count, 18), planned.missed,
        )  # fmt: skip
        return np.concatenate(parts, axis=1)[:, : len(self._low)].clip(self._low, self._high)

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return observations, (..., number), by name and in their shapes."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }


@jitted
def measure(qpos: Any, qvel: Any, rotation: Any, feet: Any, corners: Any, radii: Any, relative: Any) -> None:
    """Write velocity along the heading, clearance, and tips in the root frame into `relative`, (n, 3 + 1 + leg * axis).

    Args:
        qpos, qvel, rotation: as in `Places`.
        feet: in the world, (n, leg, axis) [mm].
        corners: of the trunk in the root frame, (corner, axis) [mm].
        radii: of the trunk at its corners, (corner,) [mm].
        relative: filled.
    """
    for n in range(len(relative)):
        seen, turn, v = relative[n], rotation[n], qvel[n]
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
                    seen[4 + 3 * leg + k] += (feet[n, leg, axis] - qpos[n, axis]) * turn[axis, k]


def worth(qvel: np.ndarray, rotation: np.ndarray, command: float) -> np.ndarray:
    """Return the reward of a step without a fall, max(0, 1 - |v - c| / c) max(0, u), of insects in their states now.

    Args:
        qvel: (n, velocity).
        rotation: from the root frames to the world, (n, axis, axis).
        command: commanded velocity [mm/s].
    """
    return np.maximum(1.0 - np.abs(qvel[:, 0] - command) / command, 0.0) * np.maximum(rotation[:, 2, 2], 0.0)
