"""The one type of walk that both measures of stability read, and what a plan adds to it for the body."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any, TypeVar

import numpy as np

from hexmj.checks import typed
from hexmj.diagrams import footfall_html
from hexmj.errors import InputError
from hexmj.legs import FIG1, LEGS, Geometry


@dataclass(frozen=True, eq=False, repr=False)
class Walk:
    """Where the tips are, seen from the centre of mass, and which of them stand.

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
        typed("geometry", self.geometry, Geometry)
        shape = typed("a walk's stance", self.stance, np.ndarray).shape
        if len(shape) != 3:
            raise InputError(f"a walk's stance is of the shape {shape}; expected (step, start, leg)")
        if shape[2] != len(LEGS):
            raise InputError(f"a walk's stance is of {shape[2]} legs; expected {len(LEGS)}")
        expected_of = {"time": shape[:1], "velocity": shape[:2]}
        for name in _arrays(type(self)):
            values, kind = getattr(self, name), bool if name == "stance" else float
            expected = expected_of.get(name, shape)
            odd = type(values) is not np.ndarray and np.ma.is_masked(typed(f"a walk's {name}", values, np.ndarray))
            if values.shape != expected or values.dtype != kind or odd:
                raise InputError(
                    f"a walk's {name} is {values.dtype} of the shape {values.shape}; expected {np.dtype(kind)} of the"
                    f" shape {expected}: its steps, starts and legs"
                )

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


def checked_walk(walk: Walk) -> Walk:
    """What shall be a walk.

    Raises:
        InputError: it is none; of a physical walk it names those that this has.
    """
    if isinstance(getattr(walk, "measured", None), Walk):
        raise InputError(f"walk is a {type(walk).__name__}; expected a Walk: its `planned`, `ordered` or `measured`")
    return typed("walk", walk, Walk)


def check_time_grows(walk: Walk) -> None:
    """Refuse a walk that is none, as of several that were joined.

    Raises:
        InputError: its time is not finite, or does not grow with each step.
    """
    if not (np.isfinite(walk.time).all() and (np.diff(walk.time) > 0).all()):
        raise InputError("a walk whose time does not grow with each step; expected that of one walk")


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
    if not 0 <= typed("start", start, int) < count:
        raise InputError(f"start = {start}; expected 0 to {count - 1}")
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
