"""The one type of walk that both measures of stability read, and what a plan adds to it for the body."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any, TypeVar

import numpy as np

from hexmj.diagrams import footfall_html
from hexmj.errors import InputError
from hexmj.legs import FIG1, LEGS, Geometry
from hexmj.validate import whole


@dataclass(frozen=True, eq=False, repr=False)
class Walk:
    """Positions of the tips relative to the centre of mass, and which of them stand.

    A planned walk has the paper's centre of mass (fixed at O) and the tips as planned; a measured
    walk has the body's own centre of mass, the physical tips and the feet that touch the ground.
    """

    time: np.ndarray
    """(step,) time at the end of each step [time units]."""
    velocity: np.ndarray
    """(step, start) commanded velocity V_r during each step, as a fraction of V_p."""
    x: np.ndarray
    """(step, start, leg) tips on their own axes O_i X_i [mm]."""
    y: np.ndarray
    """(step, start, leg) tips beside the body axis, left positive [mm]."""
    stance: np.ndarray
    """(step, start, leg) True where the leg retracts (planned) or touches the ground (measured)."""
    geometry: Geometry = FIG1
    """Origins of the legs' axes."""

    def __post_init__(self) -> None:
        shape = np.shape(self.stance)
        if len(shape) != 3 or shape[2] != len(LEGS):
            raise InputError(f"stance has the shape {shape}; expected (step, start, leg) with 6 legs")
        for name, expected in {"time": shape[:1], "velocity": shape[:2], "x": shape, "y": shape}.items():
            if (found := np.shape(getattr(self, name))) != expected:
                raise InputError(f"{name} has the shape {found}; expected {expected}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({extent(self)})"

    def _repr_html_(self) -> str | None:
        """What a notebook shows."""
        if len(self.time) < 2 or not self.stance.shape[1]:
            return None
        known = ~np.isnan(self.x[:, 0])
        return footfall_html(repr(self), self.time, known & ~self.stance[:, 0], "start 0")

    @property
    def feet(self) -> np.ndarray:
        """(step, start, leg, 2) tips from the centre of mass: ahead, to the left [mm]."""
        return np.stack([self.x + np.array(self.geometry.origin), self.y], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class PlannedWalk(Walk):
    """A walk as planned, with what a body needs to lift and lower the feet."""

    aep: np.ndarray = field(kw_only=True)
    """(step, start, leg) where the swing that a leg is in will end, on its own axis [mm], so that the body can lower
    the foot in time; NaN where nothing tells: then it is lowered once the leg stands."""
    height: np.ndarray = field(kw_only=True)
    """(step, start, leg) of the tip above the ground it walks on [mm]; NaN where the body shall lift and lower it."""


def extent(walk: Walk) -> str:
    """How many steps and starts a walk has, how long it is and how fast, in a line."""
    steps, starts = walk.stance.shape[:2]
    known = walk.velocity[np.isfinite(walk.velocity)]
    ends = sorted({f"{v:.3g}" for v in (known.min(), known.max())}, key=float) if len(known) else ["unknown"]
    end = f" to t = {walk.time[-1]:.4g} time units" if steps else ""
    return f"{steps} steps{end}, {starts} start{'s' * (starts != 1)}, V = {' to '.join(ends)}"


PLANNED = ("x", "y", "stance", "aep", "height")
"""What a plan says of every step, start and leg."""

AnyWalk = TypeVar("AnyWalk", bound=Walk)


def joined(walks: Sequence[AnyWalk]) -> AnyWalk:
    """One walk of the same starts out of those that follow each other."""
    if len(walks) == 1:
        return walks[0]
    return replace(
        walks[0], **{name: np.concatenate([getattr(one, name) for one in walks]) for name in _arrays(type(walks[0]))}
    )


def one_start(walk: AnyWalk, start: int) -> AnyWalk:
    """The walk of one start, its axis kept.

    Raises:
        InputError: there is no such start.
    """
    count = walk.stance.shape[1]
    whole("start", start, 0, count - 1)
    return of_starts(walk, slice(start, start + 1))


def of_starts(walk: AnyWalk, which: Any) -> AnyWalk:
    """The walks of some starts."""
    return replace(walk, **{name: getattr(walk, name)[:, which] for name in _arrays(type(walk)) if name != "time"})


def part_of(walk: AnyWalk, steps: slice) -> AnyWalk:
    """Some steps of a walk."""
    return replace(walk, **{name: getattr(walk, name)[steps] for name in _arrays(type(walk))})


def copied(walk: AnyWalk) -> AnyWalk:
    """The same walk in arrays of its own."""
    return replace(walk, **{name: getattr(walk, name).copy(order="K") for name in _arrays(type(walk))})


@cache
def _arrays(kind: type[Walk]) -> list[str]:
    """Names of what a walk holds of every step."""
    return [one.name for one in fields(kind) if one.name != "geometry"]
