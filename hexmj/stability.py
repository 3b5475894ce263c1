"""Static stability (paper, Section 3): support polygon, signed stability margin, first loss.

The functions take any feet, planned or simulated.  The compiled network decides about stability by a closed form
that holds only for the paper's geometry (`controllers.cruse1998.kernel`); a test compares both.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.jitted import jitted, part
from hexmj.threads import run_blocks
from hexmj.validate import numbers, states
from hexmj.walks import Walk

ROUNDING = 4.0 * 2.0**-53
"""Maximum rounding error of a difference of two products, relative to the sum of their magnitudes (Shewchuk 1997,
orient2d); a foot that is no farther from a line counts as lying on it."""

BLOCK = 4096
"""Number of postures that one thread computes at a time."""


def stability_margin(feet: ArrayLike, stance: ArrayLike, threads: int | None = None) -> np.ndarray:
    """Return the signed distance from the centre of mass to the nearest edge of the support polygon.

    Args:
        feet: tips relative to the projected centre of mass, (..., leg, 2) [mm].
        stance: True for feet that stand, (..., leg).
        threads: number of threads, by default one per core.

    Returns:
        (...) [mm]: positive if and only if the centre of mass lies strictly within the polygon (Section 3),
        else 0 or negative, as with fewer than three standing feet; -inf if no foot stands.

    Raises:
        InputError: the shapes do not fit together, or a standing foot is not finite.
    """
    tips, stands = _checked(feet, stance)
    if stands.shape[-1:] != (6,):
        raise InputError(f"stance has the shape {stands.shape}; expected (..., leg) with 6 legs")
    return _margins(tips, stands, threads)


def _checked(feet: ArrayLike, stance: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return feet, (..., leg, 2), and stance, (..., leg), if their shapes fit and all standing feet are finite."""
    tips, stands = numbers("feet", feet), states("stance", stance)
    if tips.shape != (*stands.shape, 2):
        raise InputError(f"shapes: feet {tips.shape}, stance {stands.shape}; expected (..., leg, 2) and (..., leg)")
    if not np.isfinite(tips[stands]).all():
        raise InputError("feet: the position of a standing foot is NaN or infinite")
    return tips, stands


def _margins(tips: np.ndarray, stands: np.ndarray, threads: int | None) -> np.ndarray:
    """Return the stability margins of postures that are known to be valid, see `stability_margin`."""
    points, standing = np.ascontiguousarray(tips).reshape(-1, 6, 2), stands.reshape(-1, 6)
    margin = np.empty(len(points))

    def work(begin: int, end: int) -> None:
        margins(points[begin:end], standing[begin:end], margin[begin:end])

    if len(points) <= BLOCK:
        work(0, len(points))
    else:
        run_blocks(work, len(points), BLOCK, threads)
    return margin.reshape(stands.shape[:-1])


def walk_margin(walk: Walk, threads: int | None = None) -> np.ndarray:
    """Return the stability margin after each step, (step, start) [mm]; NaN if all tips are NaN, as after a fall."""
    margin = _margins(walk.feet, walk.stance, threads)
    return np.where(np.isnan(walk.x + walk.y).all(axis=-1), np.nan, margin)


def loss_time(walk: Walk, threads: int | None = None) -> np.ndarray:
    """Return the time of the first loss of static stability (Eq. 7), (start,) [time units]; inf without a loss.

    Raises:
        InputError: the walk has no steps.
    """
    lost = walk_margin(walk, threads) <= 0.0
    if not len(lost):
        raise InputError("walk has 0 steps; expected at least 1")
    return np.where(lost.any(axis=0), walk.time[np.argmax(lost, axis=0)], np.inf)


def support_polygon(feet: ArrayLike, stance: ArrayLike) -> np.ndarray:
    """Return the corners of the support polygon of one posture, counter-clockwise, (corner, 2) [mm].

    Args:
        feet: tips, (leg, 2) [mm].
        stance: True for feet that stand, (leg,).

    Raises:
        InputError: the shapes do not fit together, or a standing foot is not finite.
    """
    tips, stands = _checked(feet, stance)
    if stands.ndim != 1:
        raise InputError(f"stance has the shape {stands.shape}; expected (6,)")
    points = tips[stands]
    if len(points) < 3:
        return points
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points - points[0]).vertices]
    except QhullError:  # all feet lie on one line
        return points


@jitted
def margins(feet: Any, stance: Any, margin: Any) -> None:
    """Write the stability margins of postures, (posture, leg, 2), to `margin`, (posture,); for compiled code."""
    for n in range(len(feet)):
        margin[n] = margin_of(feet[n], stance[n])


@part
def margin_of(f, s):
    """Return the stability margin of one posture, feet (leg, 2) and stance (leg,); for compiled code.

    Two standing feet are the ends of an edge of the polygon if all other standing feet lie on one side of their line.
    """
    nearest, inside = np.inf, True
    for a in range(6):
        if not s[a]:
            continue
        for b in range(a):
            if not s[b]:
                continue
            ex, ey = f[b, 0] - f[a, 0], f[b, 1] - f[a, 1]
            length = ex * ex + ey * ey
            if length == 0.0:
                continue
            left = right = False
            for c in range(6):
                if s[c]:
                    along_y, along_x = ex * (f[c, 1] - f[a, 1]), ey * (f[c, 0] - f[a, 0])
                    error = ROUNDING * (abs(along_y) + abs(along_x))
                    left |= along_y - along_x > error
                    right |= along_x - along_y > error
            if left and right:
                continue
            side = ey * f[a, 0] - ex * f[a, 1]  # on which the centre of mass lies
            inside &= (left and side > 0.0) or (right and side < 0.0)
            along = -(f[a, 0] * ex + f[a, 1] * ey) / length
            along = min(max(along, 0.0), 1.0)
            nearest = min(nearest, np.hypot(f[a, 0] + along * ex, f[a, 1] + along * ey))
    if nearest == np.inf:  # all standing feet are at one point
        inside = False
        for a in range(6):
            if s[a]:
                nearest = np.hypot(f[a, 0], f[a, 1])
    return nearest if inside else -nearest
