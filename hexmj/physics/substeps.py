"""Fine steps: a step of the plan in which a foot strikes the ground is repeated with shorter physics steps.

If a body tips or a swing ends early, a foot comes down at 0.4 m/s and more. Such a foot moves 0.25 mm into the ground
in one physics step, before the contact can act. It needs shorter steps, and contacts as hard as these steps allow.
Only the few steps of the plan that need it are repeated. On soft ground, contacts act slowly, and no step needs it.

Whether a step is repeated depends only on the body itself, so results do not depend on the rest of the batch. A body
that diverges is an error, even in a step that would be repeated.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.jitted import jitted
from hexmj.physics.engine import Diverged, Engine

Shown = dict[str, np.ndarray]
"""Record of n bodies: sensors, force, torque, depth and the states after each substep, by name, (n, substep, ...)."""

SINK = 0.02
"""Depth of a foot in the ground, as a share of the standing height, beyond which steps are repeated."""

FINER, FINEST = 4, 64
"""Factor by which a physics step is divided, repeatedly while a foot sinks too deep, and maximum number of parts."""

BRAKED = 0.5
"""Assumed share of its speed that a foot in the ground keeps over one physics step; measured: 0.2 to 0.7."""


@dataclass(frozen=True, eq=False)
class FineSteps:
    """Takes whole steps of a plan; if a foot strikes the ground in a step, repeats it with shorter physics steps."""

    engine: Engine
    """Engine that steps the bodies."""
    substeps: int
    """Physics steps in one step of the plan."""
    depth_of: Callable[[np.ndarray], np.ndarray]
    """Function from feet in the world, (..., 3) [mm], to their depth in the ground, (...) [mm]."""
    allowed: float
    """Depth of a foot in the ground beyond which a step is repeated [mm]."""
    forces: np.ndarray
    """Columns of the sensors that measure forces, (column,)."""

    @classmethod
    def of(cls, engine: Engine, substeps: int, compiled: CompiledBody) -> "FineSteps":
        """Return the fine steps for an engine that steps a compiled body."""
        columns = compiled.columns
        forces = np.r_[columns.touch, columns.feet_push]
        return cls(engine, substeps, compiled.depth, allowed_depth(compiled), forces)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """Step the bodies `ids` over the substeps of some controls, (n, substep, actuator), and return their record.

        If a foot strikes the ground, its body is put back to the beginning of that step of the plan and repeats it.

        Raises:
            Diverged: the first body that diverges.
        """
        m, end = self.substeps, control.shape[1]
        before, shown, struck = self._roll(ids, control, 0, end, 1)
        while (begin := struck.min(initial=end)) < end:
            again, then = np.flatnonzero(struck == begin), min(begin + m, end)
            few, struck[again] = ids[again], end
            self.engine.put(few, shown["after"][again, begin - 1] if begin else before[again])
            _overwrite(shown, again, begin, self._roll_finely(few, control[again], begin, then, FINER))
            if then < end:
                _, rest, struck[again] = self._roll(few, control[again], then, end, 1)
                _overwrite(shown, again, then, rest)
        return shown

    def _roll(
        self, ids: np.ndarray, control: np.ndarray, begin: int, end: int, parts: int
    ) -> tuple[np.ndarray, Shown, np.ndarray]:
        """Step bodies from substep `begin` to `end`, each substep in so many parts.

        Returns:
            The states before, (n, state), the record of every part, and the first substep of the first step of the plan
            in which a foot strikes, (n,), or `end`.
        """
        try:
            seen = self.engine.roll(ids, control[:, begin:end].repeat(parts, axis=1), parts)
        except Diverged as error:
            error.substep = begin
            raise
        depth, m = self.depth_of(seen.feet), self.substeps
        strike = strikes(depth, parts * m, self.allowed)
        shown = {"sensors": seen.sensors, "force": seen.force, "torque": seen.torque, "after": seen.after}
        shown["depth"] = depth[:, 1:].max(axis=2)
        struck = np.where(strike.any(axis=1), begin + np.argmax(strike, axis=1) // (parts * m) * m, end)
        return seen.before, shown, struck

    def _roll_finely(self, ids: np.ndarray, control: np.ndarray, begin: int, end: int, parts: int) -> Shown:
        """Take the substeps of one plan step in parts, in more parts while a foot strikes; return their record."""
        before, every, struck = self._roll(ids, control, begin, end, parts)
        torque = every["torque"].reshape(len(ids), end - begin, parts, every["torque"].shape[2])
        shown = {
            "sensors": in_whole_steps(every["sensors"], parts, self.forces),
            "force": every["force"][:, ::parts],
            "torque": torque.mean(axis=2),
            "depth": every["depth"].reshape(len(ids), -1, parts).max(axis=2),
            "after": every["after"][:, parts - 1 :: parts],
        }
        if parts < FINEST and (again := np.flatnonzero(struck < end)).size:
            self.engine.put(ids[again], before[again])
            finer = self._roll_finely(ids[again], control[again], begin, end, FINER * parts)
            _overwrite(shown, again, 0, finer)
        return shown


def allowed_depth(compiled: CompiledBody) -> float:
    """Return the depth of a body's foot in the ground beyond which a step is repeated [mm]; inf for soft ground."""
    return math.inf if compiled.conditions.softness else SINK * compiled.conditions.standing_height


def _overwrite(shown: Shown, rows: np.ndarray, begin: int, new: Shown) -> None:
    """Overwrite some rows of a record by a new record, from the substep `begin` on."""
    for name, values in new.items():
        shown[name][rows, begin : begin + values.shape[1]] = values


@jitted
def strikes(depth: Any, substeps: int, allowed: float) -> Any:
    """Return whether a foot gets too deep in each physics step, or will be too deep one step later, (n, step).

    The second condition is checked only in the last physics step of a step of the plan. Otherwise a foot that strikes
    early in the next step would already be too deep and too fast where the repetition begins.

    Args:
        depth: depth of the feet before the first and after each physics step, (n, 1 + step, leg) [mm]; negative above
            ground. The first physics step is the first of a step of the plan.
        substeps: number of physics steps in one step of the plan.
        allowed: maximum depth without a strike [mm].
    """
    struck = np.zeros((depth.shape[0], depth.shape[1] - 1), dtype=np.bool_)
    for n in range(struck.shape[0]):
        for step in range(struck.shape[1]):
            for leg in range(depth.shape[2]):
                after = depth[n, step + 1, leg]
                struck[n, step] |= after > allowed
                if step % substeps == substeps - 1:
                    sinks = after - depth[n, step, leg]
                    struck[n, step] |= after + (BRAKED if after > 0 else 1.0) * sinks > allowed
    return struck


def in_whole_steps(sensors: np.ndarray, fine: int, forces: np.ndarray) -> np.ndarray:
    """Return the sensors of whole steps, (..., step, column), from the sensors of their parts, (..., part, column).

    A step has `fine` parts. The columns `forces` are means over the parts; the others are those of the first part.
    """
    parts = sensors.reshape(*sensors.shape[:-2], -1, fine, sensors.shape[-1])
    whole = parts[..., 0, :].copy()
    whole[..., forces] = parts[..., forces].mean(axis=-2)
    return whole
