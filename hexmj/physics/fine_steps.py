"""Feet that strike the ground: a step of the plan in which one would sink in is taken again, more finely.

A body that tips, or a swing that ends early, brings a foot down at 0.4 m/s and more.  One physics step takes it
0.25 mm into the ground before any contact can act, so it needs shorter steps and a contact as hard as they allow.  Few
of a plan's steps need it, and only those are divided; `docs/feet_that_land.md` has the figures.

Whether a step is taken again depends on nothing but its own body, so results do not depend on the batch.  A body that
diverges ends everything even in steps that would have been taken again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.jitted import jitted
from hexmj.physics.backend import Diverged, Engine

Shown = dict[str, np.ndarray]
"""What is shown of some bodies by its name, each (n, substep, ...): sensors, force, torque, depth, and the states
after."""

SINK = 0.02
"""How deep a foot may be in the ground, as a share of the standing height."""

FINER, FINEST = 4, 64
"""Into how many parts a physics step is divided, again and again while a foot sinks in; and into how many at most."""

BRAKED = 0.5
"""Share of its speed that a foot in the ground is taken to keep over a physics step; measured are 0.2 to 0.7."""


@dataclass(frozen=True, eq=False)
class FineSteps:
    """The loop that takes whole steps of a plan, and those again, more finely, in which a foot strikes."""

    engine: Engine
    """Steps the bodies."""
    substeps: int
    """Physics steps in one of the plan."""
    depth_of: Callable[[np.ndarray], np.ndarray]
    """How deep feet in the world are in the ground, (..., 3) -> (...) [mm]."""
    allowed: float
    """How deep a foot may be [mm]."""
    forces: np.ndarray
    """Columns of the sensors that hold forces, (column,)."""

    @classmethod
    def of(cls, engine: Engine, substeps: int, compiled: CompiledBody) -> "FineSteps":
        """Of an engine that steps such a body."""
        columns = compiled.columns
        forces = np.r_[columns.touch, columns.feet_push]
        return cls(engine, substeps, compiled.depth, allowed_depth(compiled), forces)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """What some bodies show while they take the substeps of these controls, (n, substep, actuator).

        What strikes the ground is put back to where that step of the plan began, takes it finely, and goes on.

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
        """Every part of some substeps, after the states before, (n, state); and where the first step begins in which a
        foot strikes, (n,), or `end`."""
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
        """One step's substeps in parts, in more where even then a foot strikes; shown is every substep."""
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
    """How deep a foot of a body may be in the ground [mm]."""
    return SINK * compiled.conditions.standing_height


def _show(shown: Shown, rows: np.ndarray, begin: int, instead: Shown) -> None:
    """Show something else of some rows, from a substep on."""
    for name, values in instead.items():
        shown[name][rows, begin : begin + values.shape[1]] = values


@jitted
def strikes(depth: Any, substeps: int, allowed: float) -> Any:
    """In which physics steps a foot gets too deep, or will be too deep one step later, (n, step).

    The latter is asked only where a step of the plan ends: the next one can be taken again from there, not from
    before, and then it would begin with a foot that is too deep and too fast.

    Args:
        depth: of the feet before the first and after each physics step, (n, 1 + step, leg) [mm]; negative above ground.
            It begins where a step of the plan begins.
        substeps: physics steps in one of the plan.
        allowed: how deep a foot may be [mm].
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
    """What sensors show as each step begins that was taken in `fine` parts, (..., step, column), from what they show as
    each part does, (..., step * part, column); `forces`, in these columns, are the means over its parts."""
    parts = sensors.reshape(*sensors.shape[:-2], -1, fine, sensors.shape[-1])
    whole = parts[..., 0, :].copy()
    whole[..., forces] = parts[..., forces].mean(axis=-2)
    return whole
