"""Newton's method for a chain of hinges whose foot shall reach a tip.

The solution is sought from posture home, with damping where a whole step does not bring the foot closer, and with
joints held at their limits while the step would take them beyond; where that ends elsewhere it begins again from a few
other postures.  With more than three hinges the foot is then held at the tip while the angles slide toward home, until
none near by is nearer [rad, Euclidean].
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

CLOSE = 1e-10
"""Greatest distance of a foot from its tip [mm]."""

FARTHEST = 0.5
"""Greatest change of an angle in one step [rad]."""

ATTEMPTS = 12
"""Postures to begin from before a tip counts as out of reach."""

PRIMES = (2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0)
"""Their roots are the irrational numbers with which these postures are spread."""

STEPS = 60
"""Steps from one posture, accepted or not, after which a tip counts as out of reach from there."""

SLIDES, STILL = 200, 1e-10
"""Steps along the postures that reach a tip, and how small they are where the nearest to home is found [rad]."""


@njit(cache=True, nogil=True)
def reach(tips: Any, chains: Any) -> tuple[Any, Any]:
    """Angles that put tips, (n, leg, axis), where they are wanted, (n, leg, joint), and whether any do, (n, leg).

    `chains` are `numeric.HingeChains`.
    """
    legs, hinges = chains.zero.shape
    joints = np.empty((len(tips), legs, hinges))
    reachable = np.empty((len(tips), legs), dtype=np.bool_)
    one, free = np.empty(hinges), np.full(hinges, math.inf)
    work = _Work(np.empty((hinges, 3)), np.empty((hinges, 3)), np.empty(3), one, one.copy(), -free, free)
    for n in range(len(tips)):
        for leg in range(legs):
            angles = joints[n, leg]
            near = _within_length(tips[n, leg], leg, chains)
            reachable[n, leg] = near and _reached(angles, tips[n, leg], leg, chains, work)
            if not reachable[n, leg]:
                angles[:] = math.nan
    return joints, reachable


class _Work(NamedTuple):
    """Arrays that are written over and over."""

    columns: Any
    """Change of the tip with each angle, (joint, axis) [mm/rad]."""
    axes: Any
    """Of the hinges, (joint, axis)."""
    error: Any
    """From the foot to the tip that is wanted, (axis,) [mm]."""
    step: Any
    """Change of the angles, (joint,) [rad]."""
    trial: Any
    """Angles after it, (joint,) [rad]."""
    lowest: Any
    """No least angles, (joint,)."""
    highest: Any
    """No greatest angles, (joint,)."""


@njit(cache=True, nogil=True)
def _within_length(tip: Any, leg: int, chains: Any) -> bool:
    """Whether a tip is no farther from the first hinge than the leg is long; false where it is not finite."""
    length, squared = _norm(chains.foot[leg]), 0.0
    for j in range(1, chains.zero.shape[1]):
        length += _norm(chains.offset[leg, j])
    for axis in range(3):
        squared += (tip[axis] - chains.offset[leg, 0, axis]) ** 2
    return math.sqrt(squared) <= length + CLOSE


@njit(cache=True, nogil=True)
def _reached(angles: Any, tip: Any, leg: int, chains: Any, work: Any) -> bool:
    """Whether a posture is found that reaches a tip; it is written to `angles`.

    From each posture the way leads within the ranges first; where it ends at a limit, beyond them and perhaps back.
    """
    low, high, hinges = chains.low[leg], chains.high[leg], chains.zero.shape[1]
    for attempt in range(ATTEMPTS):
        for beyond in range(2):
            _begin(angles, attempt, leg, chains)
            if beyond:
                if _newton(angles, tip, leg, chains, work, work.lowest, work.highest) > CLOSE:
                    continue
                for j in range(hinges):
                    turns = round((angles[j] - (low[j] + high[j]) / 2) / (2 * math.pi))
                    angles[j] = min(max(angles[j] - 2 * math.pi * turns, low[j]), high[j])
            if _newton(angles, tip, leg, chains, work, low, high) <= CLOSE:
                if hinges > 3:
                    _slide_home(angles, tip, leg, chains, work)
                return True
    return False


@njit(cache=True, nogil=True)
def _begin(angles: Any, attempt: int, leg: int, chains: Any) -> None:
    """Postures to begin from: home, then some that fill the ranges evenly, as multiples of irrational numbers do."""
    for j in range(len(angles)):
        share = (attempt * math.sqrt(PRIMES[j % len(PRIMES)])) % 1.0
        low, high = chains.low[leg, j], chains.high[leg, j]
        angles[j] = chains.home[leg, j] if attempt == 0 else low + share * (high - low)


@njit(cache=True, nogil=True)
def _newton(angles: Any, tip: Any, leg: int, chains: Any, work: Any, low: Any, high: Any) -> float:
    """Bring the foot to a tip as near as Newton's method can; its distance [mm]."""
    hinges, damping = len(angles), 0.0
    distance = _look(angles, tip, leg, chains, work)
    for _ in range(STEPS):
        _step(angles, angles, low, high, damping, work)
        largest = 0.0
        for j in range(hinges):
            largest = max(largest, abs(work.step[j]))
        if not largest > 0.0 and damping == 0.0:
            break
        shorter = min(1.0, FARTHEST / largest) if largest > 0.0 else 1.0
        for j in range(hinges):
            work.trial[j] = min(max(angles[j] + shorter * work.step[j], low[j]), high[j])
        closer = _look(work.trial, tip, leg, chains, work)
        if closer < distance:
            close = distance <= CLOSE  # one step more than needed brings it to the last digits
            angles[:] = work.trial
            distance = closer
            damping = 0.0 if damping < 1e-5 else damping / 10.0
            if close:
                break
        else:
            if distance <= CLOSE or damping > 1e6:
                break
            damping = max(1e-3, 10.0 * damping)
            _look(angles, tip, leg, chains, work)
    return distance


@njit(cache=True, nogil=True)
def _slide_home(angles: Any, tip: Any, leg: int, chains: Any, work: Any) -> None:
    """Among the postures that reach a tip go down the distance from home as far as it goes."""
    low, high, home = chains.low[leg], chains.high[leg], chains.home[leg]
    share, start = 1.0, np.empty_like(angles)
    for _ in range(SLIDES):
        start[:] = angles
        _look(angles, tip, leg, chains, work)
        _step(angles, home, low, high, 0.0, work)
        largest, from_home = 0.0, 0.0
        for j in range(len(angles)):
            largest = max(largest, abs(work.step[j]))
            from_home += (start[j] - home[j]) ** 2
        if not largest > STILL:
            return
        for j in range(len(angles)):
            angles[j] = min(max(start[j] + share * work.step[j], low[j]), high[j])
        reached = _newton(angles, tip, leg, chains, work, low, high) <= CLOSE
        nearer = 0.0
        for j in range(len(angles)):
            nearer += (angles[j] - home[j]) ** 2
        if reached and nearer < from_home:
            share = min(1.0, 2.0 * share)
        else:
            angles[:] = start
            share /= 2.0
            if share * largest < STILL:
                return


@njit(cache=True, nogil=True)
def _step(angles: Any, toward: Any, low: Any, high: Any, damping: float, work: Any) -> None:
    """Of the steps that bring the foot to the tip, to first order, the nearest to the way toward other angles.

    It is d + J^T (J J^T + damping)^-1 (error - J d), where d is that way.  Joints at a limit that it would take beyond
    are held, one after the other, and the others take over.
    """
    held, again = 0, True
    while again:
        again = False
        x, y, z = work.error
        for j in range(len(angles)):
            if not held >> j & 1:
                way, column = toward[j] - angles[j], work.columns[j]
                x, y, z = x - column[0] * way, y - column[1] * way, z - column[2] * way
        a, b, c = _pushed(work.columns, held, damping, x, y, z)
        for j in range(len(angles)):
            work.step[j] = 0.0
            if not held >> j & 1:
                column = work.columns[j]
                step = toward[j] - angles[j] + column[0] * a + column[1] * b + column[2] * c
                if (angles[j] >= high[j] and step > 0) or (angles[j] <= low[j] and step < 0):
                    held |= 1 << j
                    again = True
                else:
                    work.step[j] = step


@njit(cache=True, nogil=True)
def _pushed(
    columns: Any, held: int, damping: float, error_x: float, error_y: float, error_z: float
) -> tuple[float, float, float]:
    """(J J^T + damping)^-1 error by Cramer's rule, J being the columns of joints that are not held.

    Damping is a share of J J^T's trace.  Where it is singular nothing moves.
    """
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(len(columns)):
        if not held >> j & 1:
            x, y, z = columns[j]
            xx += x * x
            xy += x * y
            xz += x * z
            yy += y * y
            yz += y * z
            zz += z * z
    extra = damping * (xx + yy + zz)
    xx, yy, zz = xx + extra, yy + extra, zz + extra
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    if not determinant > 1e-30 * (xx + yy + zz) ** 3:
        return 0.0, 0.0, 0.0
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    x, y, z = error_x / determinant, error_y / determinant, error_z / determinant
    return a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z


@njit(cache=True, nogil=True)
def _look(angles: Any, tip: Any, leg: int, chains: Any, work: Any) -> float:
    """Compose the chain: the columns of J and the error are written; distance of the foot from the tip [mm]."""
    columns, axes, error = work.columns, work.axes, work.error
    px = py = pz = 0.0
    xx, xy, xz = 1.0, 0.0, 0.0  # the frame's axes x, y and z in the root frame
    yx, yy, yz = 0.0, 1.0, 0.0
    zx, zy, zz = 0.0, 0.0, 1.0
    for j in range(len(angles)):
        a, b, c = chains.offset[leg, j]
        px, py, pz = px + xx * a + yx * b + zx * c, py + xy * a + yy * b + zy * c, pz + xz * a + yz * b + zz * c
        r = chains.rotation[leg, j]
        ux = xx * r[0, 0] + yx * r[1, 0] + zx * r[2, 0]
        uy = xy * r[0, 0] + yy * r[1, 0] + zy * r[2, 0]
        uz = xz * r[0, 0] + yz * r[1, 0] + zz * r[2, 0]
        vx = xx * r[0, 1] + yx * r[1, 1] + zx * r[2, 1]
        vy = xy * r[0, 1] + yy * r[1, 1] + zy * r[2, 1]
        vz = xz * r[0, 1] + yz * r[1, 1] + zz * r[2, 1]
        zx, zy, zz = (
            xx * r[0, 2] + yx * r[1, 2] + zx * r[2, 2],
            xy * r[0, 2] + yy * r[1, 2] + zy * r[2, 2],
            xz * r[0, 2] + yz * r[1, 2] + zz * r[2, 2],
        )
        turn = angles[j] - chains.zero[leg, j]
        cosine, sine = math.cos(turn), math.sin(turn)
        xx, xy, xz = cosine * ux + sine * vx, cosine * uy + sine * vy, cosine * uz + sine * vz
        yx, yy, yz = cosine * vx - sine * ux, cosine * vy - sine * uy, cosine * vz - sine * uz
        axes[j, 0], axes[j, 1], axes[j, 2] = zx, zy, zz
        columns[j, 0], columns[j, 1], columns[j, 2] = px, py, pz
    a, b, c = chains.foot[leg]
    px, py, pz = px + xx * a + yx * b + zx * c, py + xy * a + yy * b + zy * c, pz + xz * a + yz * b + zz * c
    for j in range(len(angles)):
        x, y, z = px - columns[j, 0], py - columns[j, 1], pz - columns[j, 2]
        columns[j, 0] = axes[j, 1] * z - axes[j, 2] * y
        columns[j, 1] = axes[j, 2] * x - axes[j, 0] * z
        columns[j, 2] = axes[j, 0] * y - axes[j, 1] * x
    error[0], error[1], error[2] = tip[0] - px, tip[1] - py, tip[2] - pz
    return _norm(error)


@njit(cache=True, nogil=True)
def _norm(vector: Any) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
