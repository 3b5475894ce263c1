"""Fine steps: a step of the plan in which a foot sinks into the ground is repeated with shorter physics steps.

A body that tips, or a swing that ends early, brings a foot down at 0.4 m/s and more. One physics step takes it 0.25 mm
into the ground before a contact can act, so it needs shorter steps and a contact as hard as they allow. Only the few
steps of the plan that need it are divided.

Whether a step is repeated depends on its own body only, so results do not depend on the batch. A body that diverges
is an error even in a step that would have been repeated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.jitted import jitted
from hexmj.physics.engine import Diverged, Engine

Shown = dict[str, np.ndarray]
"""Record of some bodies by name, each (n, substep, ...): sensors, force, torque, depth, and the states after."""

SINK = 0.02
"""Allowed depth of a foot in the ground, as a share of the standing height."""

FINER, FINEST = 4, 64
"""Number of parts of a physics step, again and again while a foot sinks in; and their greatest number."""

BRAKED = 0.5
"""Assumed share of its speed that a foot in the ground keeps over a physics step; measured are 0.2 to 0.7."""


@dataclass(frozen=True, eq=False)
class FineSteps:
    """Takes whole steps of a plan, and repeats those more finely in which a foot strikes."""

    engine: Engine
    """Steps the bodies."""
    substeps: int
    """Physics steps in one step of the plan."""
    depth_of: Callable[[np.ndarray], np.ndarray]
    """Depth of feet in the world in the ground, (..., 3) -> (...) [mm]."""
    allowed: float
    """Allowed depth of a foot [mm]."""
    forces: np.ndarray
    """Columns of the sensors that are forces, (column,)."""

    @classmethod
    def of(cls, engine: Engine, substeps: int, compiled: CompiledBody) -> "FineSteps":
        """For an engine that steps this body."""
        columns = compiled.columns
        forces = np.r_[columns.touch, columns.feet_push]
        return cls(engine, substeps, compiled.depth, allowed_depth(compiled), forces)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """Let some bodies take the substeps of these controls, (n, substep, actuator), and record them.

        A body whose foot strikes the ground is put back to the beginning of that step of the plan and repeats it.

        Raises:
            Diverged: a body that diverged.
        """
        m, end = self.substeps, control.shape[1]
        before, shown, struck = self._roll(ids, control, 0, end, 1)
        while (begin := struck.min(initial=end)) < end:
            again, then = np.flatnonzero(struck == begin), min(begin + m, end)
            few, struck[again] = ids[again], end
            self.engine.put(few, shown["after"][again, begin - 1] if begin else before[again])
            _show(shown, again, begin, self._roll_finely(few, control[again], begin, then, FINER))
            if then < end:
                _, rest, struck[again] = self._roll(few, control[again], then, end, 1)
                _show(shown, again, then, rest)
        return shown

    def _roll(
        self, ids: np.ndarray, control: np.ndarray, begin: int, end: int, parts: int
    ) -> tuple[np.ndarray, Shown, np.ndarray]:
        """Take some substeps in parts.

        Returns:
            The states before, (n, state), the record of every part, and the beginning of the first step in which a foot
            strikes, (n,), or `end`.
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
        """Take one step's substeps in parts, in more where a foot still strikes; record every substep."""
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
            _show(shown, again, 0, finer)
        return shown


def allowed_depth(compiled: CompiledBody) -> float:
    """Allowed depth of a foot of a body in the ground [mm]."""
    return SINK * compiled.conditions.standing_height


def _show(shown: Shown, rows: np.ndarray, begin: int, instead: Shown) -> None:
    """Replace the record of some rows, from a substep on."""
    for name, values in instead.items():
        shown[name][rows, begin : begin + values.shape[1]] = values


@jitted
def strikes(depth: Any, substeps: int, allowed: float) -> Any:
    """Physics steps in which a foot gets too deep, or will be too deep one step later, (n, step).

    The latter counts only at the end of a step of the plan: the next one could be repeated only from there on, when
    the foot is already too deep and too fast.

    Args:
        depth: of the feet before the first and after each physics step, (n, 1 + step, leg) [mm]; negative above ground.
            It begins where a step of the plan begins.
        substeps: physics steps in one step of the plan.
        allowed: allowed depth [mm].
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
    """Sensors at the beginning of each step, (..., step, column), from those of its `fine` parts, (..., part, column).

    The columns `forces` are means over the parts.
    """
    parts = sensors.reshape(*sensors.shape[:-2], -1, fine, sensors.shape[-1])
    whole = parts[..., 0, :].copy()
    whole[..., forces] = parts[..., forces].mean(axis=-2)
    return whole
