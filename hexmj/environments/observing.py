"""Observations and rewards of all insects at once, in compiled passes.

For one insect a dozen calls of NumPy take as long as its physics. `tests/plain_observations.py` has the same formulas
in plain NumPy, and a test compares the two.
"""

from typing import Any, NamedTuple

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.environments.task import Task, observation_bounds
from hexmj.jitted import jitted, part
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
        bounds, columns = observation_bounds(compiled, task), compiled.columns
        self._bounds = np.array([np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1)])
        self._corners, no_foot = compiled.trunk_corners, compiled.body.lengths.no_foot_margin
        self._layout = compiled.joints, columns.foot.start, columns.centre_of_mass.start, task.command, no_foot
        ends = np.cumsum([low.size for low, _ in bounds.values()]).tolist()
        self._fields = [
            (name, (..., slice(end - low.size, end)), low.shape if low.ndim > 1 else ())
            for (name, (low, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def observe(
        self, places: tuple[np.ndarray, ...], standing: np.ndarray, planned: tuple[np.ndarray, ...]
    ) -> np.ndarray:
        """Return all observations of some insects, (n, number).

        Args:
            places: `Places` as a plain tuple, which compiled code receives faster.
            standing: feet that stand, (n, leg).
            planned: `Planned` as a plain tuple.
        """
        flat = np.empty((len(standing), self._bounds.shape[1]))
        observe(places, self._corners, standing, planned, self._bounds, self._layout, flat)
        return flat

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return observations, (..., number), by name and in their shapes."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }


@jitted
def observe(places: Any, corners: Any, standing: Any, planned: Any, bounds: Any, layout: Any, flat: Any) -> None:
    """Write all observations into `flat`, (n, number), clipped at their bounds.

    Args:
        places: `Places` of the insects.
        corners: of the trunk, (corner, axis), and their radii, (corner,) [mm].
        standing: feet that stand, (n, leg).
        planned: stance (n, leg), tips (n, leg, axis), and substeps out of reach (n, leg).
        bounds: least and greatest value of every number, (2, number).
        layout: number of joints, first sensor columns of feet and centre of mass, the command, and the margin without
            a foot in contact.
    """
    qpos, qvel, rotation, sensors = places
    stance, tips, missed = planned
    joints, foot, centre, command, no_foot = layout
    feet, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(flat)):
        seen, turn, q, s = flat[n], rotation[n], qpos[n], sensors[n]
        at = _observe_root(q, qvel[n], turn, joints, seen)
        seen[at] = _clearance(q, turn, corners)
        at += 1
        for leg in range(6):
            tip = s[foot + 3 * leg : foot + 3 * leg + 3]
            for k in range(3):
                seen[at + k] = 0.0
                for axis in range(3):
                    seen[at + k] += (tip[axis] - q[axis]) * turn[axis, k]
            at += 3
            feet[0, leg, 0], feet[0, leg, 1] = tip[0] - s[centre], tip[1] - s[centre + 1]
        for leg in range(6):
            seen[at + leg] = standing[n, leg]
        margins(feet, standing[n : n + 1], margin)
        seen[at + 6] = max(margin[0], no_foot)
        seen[at + 7] = command
        at += 8
        for leg in range(6):
            seen[at + leg] = stance[n, leg]
            for k in range(3):
                seen[at + 6 + 3 * leg + k] = tips[n, leg, k]
        at += 24
        for i in range(at, len(seen)):
            seen[i] = missed[n, i - at]
        for i in range(len(seen)):
            seen[i] = min(max(seen[i], bounds[0, i]), bounds[1, i])


@part
def _observe_root(q: Any, v: Any, turn: Any, joints: int, seen: Any) -> int:
    """Write joints, orientation and velocities into the first numbers of `seen`, and return their count."""
    for j in range(joints):
        seen[j] = q[ROOT_QPOS + j]
        seen[joints + j] = v[ROOT_QVEL + j]
    at = 2 * joints
    for k in range(4):
        seen[at + k] = q[3 + k]
    at += 4
    angle = np.arctan2(turn[1, 0], turn[0, 0])
    cosine, sine = np.cos(angle), np.sin(angle)
    seen[at] = cosine * v[0] + sine * v[1]
    seen[at + 1] = cosine * v[1] - sine * v[0]
    seen[at + 2] = v[2]
    for k in range(3):
        seen[at + 3 + k] = v[3 + k]
    return at + 6


@part
def _clearance(q: Any, turn: Any, corners: Any) -> float:
    """Return the height of the trunk's lowest corner [mm]."""
    lowest = np.inf
    for c in range(len(corners[0])):
        corner = corners[0][c]
        up = turn[2, 0] * corner[0] + turn[2, 1] * corner[1] + turn[2, 2] * corner[2]
        lowest = min(lowest, q[2] + up - corners[1][c])
    return lowest


def worth(qvel: np.ndarray, rotation: np.ndarray, command: float) -> np.ndarray:
    """Return the reward of a step without a fall, max(0, 1 - |v - c| / c) max(0, u), of insects in their states now.

    Args:
        qvel: (n, velocity).
        rotation: from the root frames to the world, (n, axis, axis).
        command: commanded velocity [mm/s].
    """
    return np.maximum(1.0 - np.abs(qvel[:, 0] - command) / command, 0.0) * np.maximum(rotation[:, 2, 2], 0.0)
