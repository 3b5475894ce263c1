"""Walks, planned or simulated, from which both measures of stability are computed; footfall diagrams."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from html import escape
from typing import Any, TypeVar

import numpy as np

from hexmj.errors import InputError
from hexmj.legs import FIG1, LEGS, Geometry
from hexmj.validate import whole


@dataclass(frozen=True, eq=False, repr=False)
class Walk:
    """Tips relative to the centre of mass, and the legs in stance, after each step of many starts.

    A planned walk has the paper's centre of mass (fixed at O), planned tips and planned stance. A simulated walk has
    the body's own centre of mass and tips, and the stance of the feet at the ground or of those that carry load.
    """

    time: np.ndarray
    """(step,) time at the end of each step [time units]."""
    velocity: np.ndarray
    """(step, start) commanded velocity V_r during each step, as a fraction of V_p."""
    x: np.ndarray
    """(step, start, leg) tips on their own axes O_i X_i [mm]."""
    y: np.ndarray
    """(step, start, leg) distance of the tips from the body axis, left positive [mm]."""
    stance: np.ndarray
    """(step, start, leg) True where the leg retracts (planned) or the foot supports the body (simulated)."""
    geometry: Geometry = FIG1
    """Origins of the legs' axes, and lines on which the tips move."""

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
        """Return the footfall diagram of start 0, which a notebook shows."""
        if len(self.time) < 2 or not self.stance.shape[1]:
            return None
        known = ~np.isnan(self.x[:, 0])
        return footfall_html(repr(self), self.time, known & ~self.stance[:, 0], "start 0")

    @property
    def feet(self) -> np.ndarray:
        """(step, start, leg, 2) tips relative to the centre of mass: ahead, to the left [mm]."""
        return np.stack([self.x + np.array(self.geometry.origin), self.y], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class PlannedWalk(Walk):
    """A planned walk, with the AEP and height by which a body lifts and lowers its feet."""

    aep: np.ndarray = field(kw_only=True)
    """(step, start, leg) tip at the end of the present swing, on the leg's own axis [mm]; from it the body knows when
    to lower the foot. If it is NaN, the body lowers the foot when stance begins."""
    height: np.ndarray = field(kw_only=True)
    """(step, start, leg) height of the tip above the ground [mm]; if NaN, the body itself lifts and lowers the foot."""
    aep_y: np.ndarray = field(default=None, kw_only=True)  # pyright: ignore[reportAssignmentType]
    """(step, start, leg) distance of the tip at the end of the present swing from the body axis [mm]; NaN, the default,
    if the swing moves along the body."""
    level: np.ndarray = field(default=None, kw_only=True)  # pyright: ignore[reportAssignmentType]
    """(step, start, leg) height of the ground for which the leg is lifted and lowered [mm]; by default 0."""
    left: np.ndarray = field(default=None, kw_only=True)  # pyright: ignore[reportAssignmentType]
    """(step, start) velocity to the left as a fraction of V_p; `velocity` is that forward. By default 0."""
    turn: np.ndarray = field(default=None, kw_only=True)  # pyright: ignore[reportAssignmentType]
    """(step, start) yaw rate, counterclockwise [rad / time unit]; by default 0."""

    def __post_init__(self) -> None:
        super().__post_init__()
        steps = np.shape(self.velocity)
        legs, numbers = self.stance.shape, ("left", "turn")
        own = [("aep_y", np.nan, legs), ("level", 0.0, legs), *((name, 0.0, steps) for name in numbers)]
        for name, value, shape in own:
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.broadcast_to(value, shape))


def extent(walk: Walk) -> str:
    """Describe the steps, duration, starts and velocities of a walk in one line."""
    steps, starts = walk.stance.shape[:2]
    known = walk.velocity[np.isfinite(walk.velocity)]
    ends = sorted({f"{v:.3g}" for v in (known.min(), known.max())}, key=float) if len(known) else ["unknown"]
    end = f" to t = {walk.time[-1]:.4g} time units" if steps else ""
    return f"{steps} steps{end}, {starts} start{'s' * (starts != 1)}, V = {' to '.join(ends)}"


PLANNED = ("x", "y", "stance", "aep", "aep_y", "height", "level")
"""Names of the arrays (step, start, leg) of a `PlannedWalk`."""

AnyWalk = TypeVar("AnyWalk", bound=Walk)


def joined(walks: Sequence[AnyWalk]) -> AnyWalk:
    """Return successive parts of a walk of the same starts as one walk."""
    if len(walks) == 1:
        return walks[0]
    return replace(
        walks[0], **{name: np.concatenate([getattr(walk, name) for walk in walks]) for name in _arrays(type(walks[0]))}
    )


def one_start(walk: AnyWalk, start: int) -> AnyWalk:
    """Return the walk of one start, (step, 1, leg).

    Raises:
        InputError: there is no such start.
    """
    whole("start", start, 0, walk.stance.shape[1] - 1)
    return of_starts(walk, slice(start, start + 1))


def of_starts(walk: AnyWalk, which: Any) -> AnyWalk:
    """Return the walk of only the starts that `which` selects."""
    return replace(walk, **{name: getattr(walk, name)[:, which] for name in _arrays(type(walk)) if name != "time"})


def part_of(walk: AnyWalk, steps: slice) -> AnyWalk:
    """Return the part of a walk with only these steps."""
    return replace(walk, **{name: getattr(walk, name)[steps] for name in _arrays(type(walk))})


def copied(walk: AnyWalk) -> AnyWalk:
    """Return the same walk in new arrays."""
    return replace(walk, **{name: getattr(walk, name).copy(order="K") for name in _arrays(type(walk))})


@cache
def _arrays(kind: type[Walk]) -> list[str]:
    """Return the names of the fields of a walk that are arrays."""
    return [field.name for field in fields(kind) if field.name != "geometry"]


def spans(time: np.ndarray, on: np.ndarray) -> list[tuple[float, float]]:
    """Return begin and duration of each interval in which `on`, (step,), is True; `time` is each step's end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    step = time[1] - time[0] if len(time) > 1 else 0.0
    return [(float(time[a] - step), float((b - a) * step)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def footfall_html(line: str, time: np.ndarray, swings: np.ndarray, note: str, width: int = 640) -> str:
    """Return HTML for notebooks: a line of text, and a footfall diagram with a bar for each swing.

    Args:
        line: text above the diagram.
        time: time at the end of each step, (step,), at least two steps [time units].
        swings: True for feet that are off the ground, (step, leg).
        note: text below the bars, after the time.
        width: width of the bars [pixels].
    """
    row, left = 14, 28  # height of a leg's row, width of leg names [pixels]
    step = time[1] - time[0]
    begin, scale = time[0] - step, width / (time[-1] - time[0] + step)
    bars = [
        f'<rect x="{left + scale * (at - begin):.1f}" y="{row * leg + 2}" width="{scale * length:.1f}"'
        f' height="{row - 4}"/>'
        for leg in range(len(LEGS))
        for at, length in spans(time, swings[:, leg])
    ]
    names = [f'<text x="0" y="{row * (leg + 1) - 3}">{name}</text>' for leg, name in enumerate(LEGS)]
    low = row * (len(LEGS) + 1)
    caption = f"{begin:.4g} to {time[-1]:.4g} time units; bars: foot off the ground{'; ' * bool(note)}{escape(note)}"
    names.append(f'<text x="{left}" y="{low}">{caption}</text>')
    style = 'style="max-width: 100%" fill="currentColor" font-family="sans-serif" font-size="11"'
    box = f'viewBox="0 0 {left + width} {low + 4}" width="{left + width}"'
    return f"<p>{escape(line)}</p><svg {box} {style}>{''.join(bars + names)}</svg>"
