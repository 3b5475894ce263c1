"""Newton's method for a chain of hinges: joint angles that put the foot at a given tip.

The search starts from posture home. It adds damping if a whole step does not bring the foot closer, and holds a joint
at its limit while a step would move the joint beyond. If the search fails, it restarts from other postures. With more
than three hinges, the angles then move toward home with the foot at the tip, until their Euclidean distance is least.
"""

import math
from typing import Any

import numpy as np

from hexmj.jitted import jitted, part

CLOSE = 1e-10
"""Maximum distance of a foot from the tip that it reaches [mm]."""

FARTHEST = 0.5
"""Maximum change of an angle in one step [rad]."""

ATTEMPTS = 24
"""Number of initial postures that are tried before a tip counts as out of reach."""

PRIMES = (2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0)
"""Primes; multiples of their square roots, modulo 1, distribute the initial postures evenly."""

STEPS, MOST_DAMPING = 60, 1e6
"""Maximum number of steps from one initial posture, including rejected steps, and maximum damping."""

SLIDES, STILL = 200, 1e-10
"""Maximum number of steps toward home, and the step size at which the search for the nearest posture ends [rad]."""

ZERO = (0.0, 0.0, 0.0)


@jitted
def reach(tips: Any, chains: Any) -> tuple[Any, Any]:
    """Return angles that reach tips, (n, leg, axis): (n, leg, joint) [rad], and whether they are found, (n, leg).

    `chains` is a `kinematics.HingeChains`. Angles that are not found are NaN.
    """
    legs, hinges = chains.zero.shape
    joints, reachable = np.empty((len(tips), legs, hinges)), np.zeros((len(tips), legs), dtype=np.bool_)
    lever = np.empty((hinges + 1, 3))
    for n in range(len(tips)):
        for leg in range(legs):
            tip = tips[n, leg]
            off = _plus(tip, -1.0, chains.anchor[leg, 0])
            if math.sqrt(_dot(off, off)) <= chains.length[leg] + CLOSE:  # False for NaN
                reachable[n, leg] = _reached(joints[n, leg], tip, leg, chains, lever)
            if not reachable[n, leg]:
                joints[n, leg] = math.nan
    return joints, reachable


@part
def _reached(angles: Any, tip: Any, leg: int, chains: Any, lever: Any) -> bool:
    """Search a posture that reaches the tip and write it to `angles`; return whether it is found.

    The first search starts from home. Restarts are quasi-random: they fill the ranges of the joints evenly.
    """
    low, high = chains.low[leg], chains.high[leg]
    for attempt in range(ATTEMPTS):
        for j in range(len(angles)):
            share = attempt * math.sqrt(PRIMES[j % len(PRIMES)]) % 1.0
            angles[j] = low[j] + share * (high[j] - low[j]) if attempt else chains.home[leg, j]
        if _newton(angles, tip, leg, chains, lever) <= CLOSE:
            if len(angles) > 3:
                _slide_home(angles, tip, leg, chains, lever)
            return True
    return False


@part
def _newton(angles: Any, tip: Any, leg: int, chains: Any, lever: Any) -> float:
    """Change `angles` until the foot is as near to the tip as Newton's method gets; return the distance left [mm]."""
    low, high = chains.low[leg], chains.high[leg]
    damping, step, trial = 0.0, np.empty_like(angles), np.empty_like(angles)
    distance = _jacobian(angles, tip, leg, chains, lever)
    for _ in range(STEPS):
        shorter = min(1.0, FARTHEST / max(_step(step, angles, angles, low, high, lever, damping), FARTHEST))
        for j in range(len(angles)):
            trial[j] = min(max(angles[j] + shorter * step[j], low[j]), high[j])
        closer = _jacobian(trial, tip, leg, chains, lever)
        if closer < distance:
            angles[:], distance = trial, closer
            damping = 0.0 if damping < 1e-5 else damping / 10.0
        elif distance <= CLOSE or damping > MOST_DAMPING:
            break
        else:
            damping = max(1e-3, 10.0 * damping)
            _jacobian(angles, tip, leg, chains, lever)
    return distance


@part
def _slide_home(angles: Any, tip: Any, leg: int, chains: Any, lever: Any) -> None:
    """Move `angles` toward home while the foot stays at the tip."""
    low, high, home = chains.low[leg], chains.high[leg], chains.home[leg]
    share, step = 1.0, np.empty_like(angles)
    for _ in range(SLIDES):
        _jacobian(angles, tip, leg, chains, lever)
        if not share * _step(step, angles, home, low, high, lever, 0.0) > STILL:
            return
        trial = np.minimum(np.maximum(angles + share * step, low), high)
        reached = _newton(trial, tip, leg, chains, lever) <= CLOSE
        if reached and ((trial - home) ** 2).sum() < ((angles - home) ** 2).sum():
            angles[:], share = trial, min(1.0, 2.0 * share)
        else:
            share /= 2.0


@part
def _step(step: Any, angles: Any, toward: Any, low: Any, high: Any, lever: Any, damping: float) -> float:
    """Write to `step` the change of the angles that brings the foot to the tip; return its largest component [rad].

    To first order it is the solution nearest to d = toward - angles: d + J^T (J J^T + damping)^-1 (error - J d).
    Joints that it would move beyond a limit are held instead. `damping` is a share of the trace of J J^T.
    """
    hinges, held, again, largest = len(angles), 0, True, 0.0
    while again:
        again, largest = False, 0.0
        x, y, z, missing = ZERO, ZERO, ZERO, _plus(ZERO, 1.0, lever[hinges])
        for j in range(hinges):
            if not held >> j & 1:
                column = lever[j]
                x, y, z = _plus(x, column[0], column), _plus(y, column[1], column), _plus(z, column[2], column)
                missing = _plus(missing, angles[j] - toward[j], column)
        push = _solved(x, y, z, damping, missing)
        for j in range(hinges):
            step[j] = 0.0
            if not held >> j & 1:
                change = toward[j] - angles[j] + _dot(lever[j], push)
                if (angles[j] >= high[j] and change > 0) or (angles[j] <= low[j] and change < 0):
                    held, again = held | 1 << j, True
                else:
                    step[j], largest = change, max(largest, abs(change))
    return largest


@part
def _solved(x: Any, y: Any, z: Any, damping: float, right: Any) -> tuple[float, float, float]:
    """Solve a damped linear system by Cramer's rule; its symmetric matrix has rows x, y, z. Return 0 if singular."""
    trace = x[0] + y[1] + z[2]
    extra = damping * trace
    x, y, z = (x[0] + extra, x[1], x[2]), (y[0], y[1] + extra, y[2]), (z[0], z[1], z[2] + extra)
    a, b, c = _cross(y, z), _cross(z, x), _cross(x, y)
    determinant = _dot(x, a)
    if not determinant > 1e-30 * trace**3:
        return ZERO
    return _dot(right, a) / determinant, _dot(right, b) / determinant, _dot(right, c) / determinant


@part
def _jacobian(angles: Any, tip: Any, leg: int, chains: Any, lever: Any) -> float:
    """Write the columns of the Jacobian J, (joint, axis), and then the error of the foot, (axis,), to `lever`.

    Return the length of the error [mm]."""
    hinges = len(angles)
    foot = _plus(ZERO, 1.0, chains.foot[leg])
    for j in range(hinges - 1, -1, -1):
        axis, anchor, turn = chains.axis[leg, j], chains.anchor[leg, j], angles[j] - chains.zero[leg, j]
        cosine, sine = math.cos(turn), math.sin(turn)
        off = _turned(_plus(foot, -1.0, anchor), axis, cosine, sine)
        for outer in range(j + 1, hinges):
            _write(lever, outer, _turned(lever[outer], axis, cosine, sine))
        _write(lever, j, _cross(axis, off))
        foot = _plus(off, 1.0, anchor)
    error = _plus(foot, -1.0, tip)
    _write(lever, hinges, _plus(ZERO, -1.0, error))
    return math.sqrt(_dot(error, error))


@part
def _turned(vector: Any, axis: Any, cosine: float, sine: float) -> tuple[float, float, float]:
    """Return a vector turned about a unit vector, by the cosine and sine of the angle."""
    x, y, z = _cross(axis, vector)
    along = (1.0 - cosine) * _dot(axis, vector)
    return (
        cosine * vector[0] + sine * x + along * axis[0],
        cosine * vector[1] + sine * y + along * axis[1],
        cosine * vector[2] + sine * z + along * axis[2],
    )


@part
def _write(rows: Any, row: int, vector: Any) -> None:
    rows[row, 0], rows[row, 1], rows[row, 2] = vector


@part
def _plus(a: Any, times: float, b: Any) -> tuple[float, float, float]:
    return a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]


@part
def _cross(a: Any, b: Any) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def _dot(a: Any, b: Any) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
