"""Draw random initial leg configurations (starts; paper, Section 3), and check starts and velocities."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.validate import distinct, leg_last, numbers, short, whole

SAMPLE = 1000
"""Number of starts of one sample in the paper, which takes seven samples."""

SLAB = 64 * SAMPLE
"""Maximum number of starts in memory at a time, where only losses are counted."""

MOST_STARTS = 10**10
"""Maximum number of starts of one FLSS; on two cores they take hours to days."""

MOST_DRAWN = 10**8
"""Maximum number of starts in one array; their tips take 5 GB."""


def draw_starts(n_starts: int, seed: int, stride: Stride | None = None) -> np.ndarray:
    """Return starts drawn uniformly from S: all legs stand between PEP_0 and AEP_0 (Section 3).

    Returns:
        (start, leg) [mm].  The first k of n starts are the same for every n.

    Raises:
        InputError: the number of starts or the seed is out of range.
    """
    n_starts, seed = whole("n_starts", n_starts, 1, MOST_DRAWN), whole("seed", seed, 0)
    return np.concatenate(list(draw_slabs(n_starts, seed, stride or Stride())))


def draw_start(start: int, seed: int, stride: Stride) -> np.ndarray:
    """Return the start of index `start` that `draw_starts` draws, (1, leg) [mm], without drawing the starts before it.

    Raises:
        InputError: the index or the seed is out of range.
    """
    start, seed = whole("start", start, 0, MOST_STARTS), whole("seed", seed, 0)
    return next(draw_slabs(1, seed, stride, start))


def draw_slabs(n_starts: int, seed: int, stride: Stride, first: int = 0) -> Iterator[np.ndarray]:
    """Yield the starts of `draw_starts` from index `first` on, in arrays (start, leg) [mm] of at most `SLAB` starts."""
    source = np.random.PCG64(seed)
    source.advance(6 * first)  # each tip advances the generator by one
    rng = np.random.Generator(source)
    for begin in range(0, n_starts, SLAB):
        yield rng.uniform(stride.pep0, stride.aep0, (min(SLAB, n_starts - begin), 6))


def check_draw(n_starts: int, seed: int, name: str = "n_starts", seed_name: str = "seed") -> tuple[int, int]:
    """Return a number of starts and a seed if both are in range; the names are for the error message."""
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
        raise InputError(f"velocity = {velocity}; expected at least {acceleration.start}, where acceleration starts")
    if v.shape not in ((), (n_starts,)):
        raise InputError(f"velocity has the shape {v.shape}; expected one number or one for each of {n_starts} starts")
    return np.broadcast_to(v, n_starts).copy()


def checked_list(velocities: Sequence[float], acceleration: Acceleration | None = None) -> np.ndarray:
    """Return the velocities of a study, (velocity,), if they are valid and distinct, and at least one is given."""
    v = np.atleast_1d(numbers("velocities", velocities))
    distinct("velocities", v.tolist())
    return checked_velocities(v, len(v), acceleration)
