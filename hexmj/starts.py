"""Random initial leg configurations (starts), all legs standing (paper, Section 3); checks of starts and velocities."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.validate import distinct, leg_last, numbers, short, whole

SAMPLE = 1000
"""Starts of one sample of the paper's protocol; it takes seven of them."""

SLAB = 64 * SAMPLE
"""Starts that are drawn and held in memory at a time where only their losses are counted."""

MOST_STARTS = 10**10
"""Most starts of one FLSS; on two cores they take hours to days."""

MOST_DRAWN = 10**8
"""Most starts in one array; their tips take 5 GB."""


def draw_starts(n_starts: int, seed: int, stride: Stride | None = None) -> np.ndarray:
    """Starts drawn uniformly from S: all legs stand between PEP_0 and AEP_0 (Section 3).

    Returns:
        (start, leg) [mm].  The first k of n starts are the same for every n.

    Raises:
        InputError: a number of starts or a seed that makes no sense.
    """
    n_starts, seed = whole("n_starts", n_starts, 1, MOST_DRAWN), whole("seed", seed, 0)
    return np.concatenate(list(draw_slabs(n_starts, seed, stride or Stride())))


def draw_start(start: int, seed: int, stride: Stride) -> np.ndarray:
    """One of the starts of `draw_starts`, (1, leg) [mm], without those before it.

    Raises:
        InputError: a number or a seed that makes no sense.
    """
    start, seed = whole("start", start, 0, MOST_STARTS), whole("seed", seed, 0)
    return next(draw_slabs(1, seed, stride, start))


def draw_slabs(n_starts: int, seed: int, stride: Stride, first: int = 0) -> Iterator[np.ndarray]:
    """The starts of `draw_starts` from `first` on, (start, leg) [mm], `SLAB` at a time, without those before them."""
    source = np.random.PCG64(seed)
    source.advance(6 * first)  # a tip takes one step of it
    rng = np.random.Generator(source)
    for begin in range(0, n_starts, SLAB):
        yield rng.uniform(stride.pep0, stride.aep0, (min(SLAB, n_starts - begin), 6))


def check_draw(n_starts: int, seed: int, name: str = "n_starts", seed_name: str = "seed") -> tuple[int, int]:
    """Return a number of starts and a seed if both are valid."""
    return whole(name, n_starts, 1, MOST_STARTS), whole(seed_name, seed, 0)


def checked_starts(starts: ArrayLike, stride: Stride) -> np.ndarray:
    """Return a copy of the starts, (start, leg) [mm], if every tip stands between PEP_min and AEP_0."""
    x = numbers("starts", leg_last(starts))
    if x.ndim != 2 or x.shape[1] != 6 or len(x) == 0:
        raise InputError(f"starts have the shape {x.shape}; expected (start, leg) with at least one start and 6 legs")
    if not ((x >= stride.pep_min) & (x <= stride.aep0)).all():
        raise InputError(f"starts: a tip stands outside the step range, {stride.pep_min} to {stride.aep0} mm")
    return x


def checked_velocities(velocity: ArrayLike, n_starts: int, acceleration: Acceleration | None) -> np.ndarray:
    """Return V_r for each start, (start,), if it lies in [0, 1) and an acceleration can reach it."""
    v = numbers("velocity", velocity)
    if not ((v >= 0) & (v < 1)).all():
        raise InputError(f"velocity = {short(v.tolist())}; expected 0 <= V < 1, a fraction of V_p")
    if acceleration and not (v >= acceleration.start).all():
        raise InputError(f"velocity = {velocity}; expected at least V_r(0) = {acceleration.start} when accelerating")
    if v.shape not in ((), (n_starts,)):
        raise InputError(f"velocity has the shape {v.shape}; expected one number or one for each of {n_starts} starts")
    return np.broadcast_to(v, n_starts).copy()


def checked_list(velocities: Sequence[float], acceleration: Acceleration | None = None) -> np.ndarray:
    """Return the velocities of a table, (velocity,), if there is at least one and all are distinct."""
    v = np.atleast_1d(numbers("velocities", velocities))
    distinct("velocities", v.tolist())
    return checked_velocities(v, len(v), acceleration)
