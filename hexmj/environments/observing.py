"""What insects observe, (insect, number) in one compiled pass, and the names and shapes of these numbers."""

from typing import NamedTuple

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.environments.compiled_passes import observe
from hexmj.environments.task import Task, observation_bounds


class Places(NamedTuple):
    """Some insects as they are now."""

    qpos: np.ndarray
    """(n, position)."""
    qvel: np.ndarray
    """(n, velocity)."""
    rotation: np.ndarray
    """From the root frames to the world, (n, axis, axis)."""
    sensors: np.ndarray
    """(n, column), of which those that measure places are current."""


class Planned(NamedTuple):
    """What is planned for some insects now."""

    stance: np.ndarray
    """Which legs may stand, (n, leg) of 0 and 1."""
    tips: np.ndarray
    """In the root frame, without offsets, (n, leg, axis) [mm]."""
    missed: np.ndarray
    """Substeps of the last step in which a tip was out of reach, (n, leg)."""


class Observer:
    """Observes insects of a body in a task."""

    def __init__(self, compiled: CompiledBody, task: Task) -> None:
        """See `task` for what is observed."""
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
        """Everything observed of some insects, (n, number); `standing` says which feet do, (n, leg).

        `places` and `planned` are `Places` and `Planned` as plain tuples, which compiled code takes over faster.
        """
        flat = np.empty((len(standing), self._bounds.shape[1]))
        observe(places, self._corners, standing, planned, self._bounds, self._layout, flat)
        return flat

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """What was observed, (..., number), by name and in its shape."""
        before = flat.shape[:-1]
        return {
            name: flat[columns].reshape(before + shape) if shape else flat[columns]
            for name, columns, shape in self._fields
        }
