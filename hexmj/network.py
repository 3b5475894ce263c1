"""The coordination network: Eq. 1-6 and 11 of the paper, compiled for many starts at once.

`LANES` starts lie side by side in a block, one row of lanes for each variable of each leg, and every
lane goes through the same operations without branches, so that the compiler fills the vector units.
``tests/plain_network.py`` holds the same equations in their readable form, start by start; both agree
to the last bit.

One step goes from the states at t to those at t + dt with V_r(t).  A walk begins with Delta(0) = 0,
AEP(0) = AEP_0 and s(-dt) = s(0): conventions of ours, where the paper is silent.
"""

from typing import get_args

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.legs import MIRROR, N2, N4
from hexmj.parameters import Acceleration, Model, Network, Order, weights
from hexmj.threads import run_blocks
from hexmj.walks import Walk

LANES = 64
MOST_STEPS = 10**9
"""Longest walk [steps]; far beyond any use, and within the kernel's integers."""
ORDERS = get_args(Order)
_UNDELAYED, _SEQUENTIAL = 1, 2

# A leg without the neighbour in question names itself, with weight 0.
_REAR = tuple(n[0] if n else d for d, n in enumerate(N2))
_FRONT = tuple(n[0] if n else d for d, n in enumerate(N4))
_CONTRA = MIRROR

# Rows of lanes of a block.  Six rows a variable, one for each leg: the tip x, the states s(t) and
# s(t - dt), AEP(t), the influences on PEP and AEP that the next step uses, and those after them.
_X, _S, _S_OLD, _AEP, _PEP_SHIFT, _AEP_SHIFT, _PEP_NEXT, _AEP_NEXT = (6 * i * LANES for i in range(8))
# One row a variable: V_r(t) and its target, the number of steps, the step of the first loss, 1 while undecided.
_V, _V_TARGET, _STEPS, _LOST, _OPEN = ((48 + i) * LANES for i in range(5))
_ROWS = 53

# The weights of each kind of neighbour as `_settings` lays them out, six numbers each, one for each destination.
_P1_REAR, _P1_CONTRA, _P2_REAR, _P4_FRONT = 0, 6, 12, 18
_P31_FRONT, _P32_FRONT, _P33_FRONT, _P34_FRONT = 24, 30, 36, 42
_P31_CONTRA, _P32_CONTRA, _P33_CONTRA, _P34_CONTRA = 48, 54, 60, 66


# The functions of one leg are inlined where they are called, with the leg's number as a constant: only then does
# the compiler see that rows do not overlap, and fills the vector units (5 times faster, measured).


@njit(inline="always")
def _influence(z, d, p, k):
    """Eq. 2-5 for leg d in all lanes: the sum of Delta^1, Delta^2 and Delta^3, and Delta^4."""
    own, rear, contra, front = d * LANES, _REAR[d] * LANES, _CONTRA[d] * LANES, _FRONT[d] * LANES
    pep_min, span, origin, origin_front = k[2], k[0] - k[2], k[4 + d], k[4 + _FRONT[d]]
    p1_rear, p1_contra, p2_rear, p4_front = p[_P1_REAR + d], p[_P1_CONTRA + d], p[_P2_REAR + d], p[_P4_FRONT + d]
    p31_front, p31_contra = p[_P31_FRONT + d], p[_P31_CONTRA + d]
    p32_front, p32_contra = p[_P32_FRONT + d], p[_P32_CONTRA + d]
    p33_front, p33_contra = p[_P33_FRONT + d], p[_P33_CONTRA + d]
    p34_front, p34_contra = p[_P34_FRONT + d], p[_P34_CONTRA + d]
    for j in range(LANES):
        v, s_rear, s_contra, s_front = z[_V + j], z[_S + rear + j], z[_S + contra + j], z[_S + front + j]
        total = (s_rear - 1.0) * p1_rear + (s_contra - 1.0) * p1_contra  # Eq. 2
        total += span * p2_rear * (s_rear * (1.0 - z[_S_OLD + rear + j]))  # Eq. 3
        ahead = p31_front + p34_front * v - z[_X + front + j]
        shift = (p32_front if ahead >= 0.0 else p33_front) * s_front * ahead
        total += shift if shift < 4.0 else 4.0  # Eq. 4
        ahead = p31_contra + p34_contra * v - z[_X + contra + j]
        shift = (p32_contra if ahead >= 0.0 else p33_contra) * s_contra * ahead
        total += shift if shift < 4.0 else 4.0  # Eq. 4
        z[_PEP_NEXT + own + j] = total
        crossed = origin + z[_X + own + j] >= origin_front + z[_X + front + j]
        z[_AEP_NEXT + own + j] = (pep_min - z[_AEP + own + j]) * p4_front if crossed else 0.0  # Eq. 5


@njit(inline="always")
def _move(z, d, pep_shift, aep_shift, k):
    """Eq. 6 for leg d in all lanes, with the influences in the rows `pep_shift` and `aep_shift`."""
    aep0, pep0, pep_min, dt, own = k[0], k[1], k[2], k[3], d * LANES
    for j in range(LANES):
        s = z[_S + own + j]
        x = z[_X + own + j] - z[_V + j] * dt * s + dt * (1.0 - s)
        aep = aep0 + z[aep_shift + own + j]
        pep = pep0 + z[pep_shift + own + j]
        pep = pep if pep > pep_min else pep_min
        lands = 1.0 if x > aep else 0.0
        stays = 0.0 if x < pep else 1.0
        z[_X + own + j] = x
        z[_AEP + own + j] = aep
        z[_S_OLD + own + j] = s
        z[_S + own + j] = stays if s == 1.0 else lands
        z[_PEP_SHIFT + own + j] = z[_PEP_NEXT + own + j]
        z[_AEP_SHIFT + own + j] = z[_AEP_NEXT + own + j]


@njit(nogil=True)
def _step_printed(z, p, k):
    """One step of a block, all six legs at once, PEP(t + dt) from Delta(t)."""
    _influence(z, 0, p, k)
    _influence(z, 1, p, k)
    _influence(z, 2, p, k)
    _influence(z, 3, p, k)
    _influence(z, 4, p, k)
    _influence(z, 5, p, k)
    _move(z, 0, _PEP_SHIFT, _AEP_SHIFT, k)
    _move(z, 1, _PEP_SHIFT, _AEP_SHIFT, k)
    _move(z, 2, _PEP_SHIFT, _AEP_SHIFT, k)
    _move(z, 3, _PEP_SHIFT, _AEP_SHIFT, k)
    _move(z, 4, _PEP_SHIFT, _AEP_SHIFT, k)
    _move(z, 5, _PEP_SHIFT, _AEP_SHIFT, k)


@njit(nogil=True)
def _step_undelayed(z, p, k):
    """One step of a block, all six legs at once, PEP(t + dt) from Delta(t + dt)."""
    for d in range(6):
        _influence(z, d, p, k)
    for d in range(6):
        _move(z, d, _PEP_NEXT, _AEP_NEXT, k)


@njit(nogil=True)
def _step_in_turn(z, p, k):
    """One step of a block, leg after leg."""
    for d in range(6):
        _influence(z, d, p, k)
        _move(z, d, _PEP_NEXT, _AEP_NEXT, k)


@njit(nogil=True)
def _step(z, t, v_start, rate, order, p, k):
    """One step of a block, to time t; V_r(t) after it by Eq. 11."""
    if order == _SEQUENTIAL:
        _step_in_turn(z, p, k)
    elif order == _UNDELAYED:
        _step_undelayed(z, p, k)
    else:
        _step_printed(z, p, k)
    if rate > 0.0:
        for j in range(LANES):
            z[_V + j] = v_start + rate * t if z[_V + j] < z[_V_TARGET + j] else z[_V_TARGET + j]  # Eq. 11


@njit(inline="always")
def _u(z, d, j, origin, per_y, lifted):
    """u = x / |y| of the foot of leg d in lane j, or `lifted` where it does not stand."""
    return (origin + z[_X + d * LANES + j]) * per_y if z[_S + d * LANES + j] == 1.0 else lifted


@njit(inline="always")
def _greatest(a, b, c):
    a = a if a > b else b
    return a if a > c else c


@njit(inline="always")
def _least(a, b, c):
    a = a if a < b else b
    return a if a < c else c


@njit(nogil=True)
def _mark_losses(z, n, k):
    """Note step n where a lane loses static stability for the first time; True while a lane is undecided.

    With u = x / |y| of the standing feet, the centre of mass lies strictly inside the support polygon
    if and only if both sides stand, max u left + max u right > 0 and min u left + min u right < 0.
    """
    o1, o2, o3, o4, o5, o6 = k[4], k[5], k[6], k[7], k[8], k[9]
    y1, y2, y3, y4, y5, y6 = k[10], k[11], k[12], k[13], k[14], k[15]
    inf, undecided = np.inf, 0.0
    for j in range(LANES):
        left = _greatest(_u(z, 0, j, o1, y1, -inf), _u(z, 1, j, o2, y2, -inf), _u(z, 2, j, o3, y3, -inf))
        right = _greatest(_u(z, 3, j, o4, y4, -inf), _u(z, 4, j, o5, y5, -inf), _u(z, 5, j, o6, y6, -inf))
        front = left + right
        left = _least(_u(z, 0, j, o1, y1, inf), _u(z, 1, j, o2, y2, inf), _u(z, 2, j, o3, y3, inf))
        right = _least(_u(z, 3, j, o4, y4, inf), _u(z, 4, j, o5, y5, inf), _u(z, 5, j, o6, y6, inf))
        unstable = (front <= 0.0) | (left + right >= 0.0)
        lost, steps = z[_LOST + j], z[_STEPS + j]
        lost = n if unstable & (lost == 0.0) & (n <= steps) else lost
        z[_LOST + j] = lost
        z[_OPEN + j] = 1.0 if (lost == 0.0) & (n < steps) else 0.0
    for j in range(LANES):
        undecided += z[_OPEN + j]
    return undecided > 0.0


@njit(cache=True, nogil=True)
def _run_until_lost(blocks, v_start, rate, order, p, k):
    """Run every block until all its lanes have lost static stability or have had their steps."""
    for b in range(blocks.shape[0]):
        z = blocks[b]
        n = 0.0
        undecided = True
        while undecided:
            n += 1.0
            _step(z, n * k[3], v_start, rate, order, p, k)
            undecided = _mark_losses(z, n, k)


@njit(cache=True, nogil=True)
def _record(blocks, done, v_start, rate, order, p, k, velocity, x, stance):
    """Run every block from step `done` on, writing V_r of each step and the tips and states after it."""
    steps, starts = velocity.shape
    for b in range(blocks.shape[0]):
        z = blocks[b]
        lanes = min(LANES, starts - b * LANES)
        for n in range(steps):
            for j in range(lanes):
                velocity[n, b * LANES + j] = z[_V + j]
            _step(z, (done + n + 1) * k[3], v_start, rate, order, p, k)
            for j in range(lanes):
                for d in range(6):
                    x[n, b * LANES + j, d] = z[_X + d * LANES + j]
                    stance[n, b * LANES + j, d] = z[_S + d * LANES + j] == 1.0


class NetworkRun:
    """The network of many starts, advanced as far as asked for."""

    def __init__(
        self,
        starts: ArrayLike,
        model: Model,
        velocity: ArrayLike,
        *,
        network: Network | None = None,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> None:
        """Put every start at time 0; the arguments are those of `walk`."""
        self.network = network or Network()
        self.done = 0
        self._starts = checked_starts(starts, self.network)
        velocity = checked_velocities(velocity, len(self._starts), acceleration)
        self._settings = _settings(model, self.network, acceleration)
        self._blocks = _blocks(self._starts, velocity, np.zeros(len(velocity)), self.network, acceleration)
        self._threads = threads

    def advance(self, steps: int) -> Walk:
        """The next `steps` steps of the walk."""
        shape = (steps, len(self._starts))
        velocity, x, stance = np.empty(shape), np.empty((*shape, 6)), np.empty((*shape, 6), dtype=bool)

        def work(begin: int, end: int) -> None:
            lanes = slice(begin * LANES, end * LANES)
            out = velocity[:, lanes], x[:, lanes], stance[:, lanes]
            _record(self._blocks[begin:end], self.done, *self._settings, *out)

        run_blocks(work, len(self._blocks), 1, self._threads)
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.network.dt
        geometry = self.network.geometry
        return Walk(time, velocity, x, np.broadcast_to(geometry.y, x.shape), stance, geometry)


def walk(
    starts: ArrayLike,
    model: Model,
    velocity: ArrayLike,
    duration: float,
    *,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> Walk:
    """The planned walk of every start: Eq. 6, with Eq. 11 where an acceleration is given.

    Args:
        starts: tips at time 0, all standing, (start, leg) [mm].
        model: coupling weights.
        velocity: V_r, or its final value V_r* when accelerating; one number or (start,), 0 <= V_r < 1.
        duration: observation time [time units of the network].
        network: the constants that the paper leaves out.
        acceleration: the accelerating procedure; without it V_r is constant.
        threads: one per core unless given; the result does not depend on it.

    Raises:
        InputError: a start, velocity or duration that makes no sense.
    """
    network = network or Network()
    run = NetworkRun(starts, model, velocity, network=network, acceleration=acceleration, threads=threads)
    return run.advance(int(steps_within(duration, network)))


def first_loss(
    starts: ArrayLike,
    model: Model,
    velocity: ArrayLike,
    duration: ArrayLike,
    *,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Time of the first loss of static stability (Eq. 7), (start,) [time units]; inf where there is none.

    The walks are those of `walk`, but only their present state is kept; `duration` may be (start,).
    """
    network = network or Network()
    starts = checked_starts(starts, network)
    velocity = checked_velocities(velocity, len(starts), acceleration)
    steps = np.broadcast_to(steps_within(duration, network), len(starts))
    settings = _settings(model, network, acceleration)
    lost = np.empty(len(starts))

    def work(begin: int, end: int) -> None:
        blocks = _blocks(starts[begin:end], velocity[begin:end], steps[begin:end], network, acceleration)
        _run_until_lost(blocks, *settings)
        lost[begin:end] = blocks[:, _LOST : _LOST + LANES].reshape(-1)[: end - begin]

    run_blocks(work, len(starts), 8 * LANES, threads)
    return np.where(lost > 0, lost * network.dt, np.inf)


def steps_within(duration: ArrayLike, network: Network) -> np.ndarray:
    """Whole steps of the network within an observation time [time units]."""
    duration = np.asarray(duration, dtype=float)
    if not ((duration >= network.dt) & (duration <= MOST_STEPS * network.dt)).all():
        raise InputError(
            f"duration = {duration}; expected at least one step, {network.dt:g}, and at most"
            f" {MOST_STEPS * network.dt:g} time units"
        )
    return np.floor(duration / network.dt + 1e-6).astype(int)


def checked_starts(starts: ArrayLike, network: Network) -> np.ndarray:
    """A copy of the starts, (start, leg) [mm], if every tip stands between PEP_min and AEP_0."""
    x = np.array(starts, dtype=float)
    if x.ndim != 2 or x.shape[1] != 6 or len(x) == 0:
        raise InputError(f"starts have the shape {x.shape}; expected (start, leg) with at least one start and 6 legs")
    if not ((x >= network.pep_min) & (x <= network.aep0)).all():
        raise InputError(f"a start lies outside the step range, {network.pep_min} to {network.aep0} mm")
    return x


def checked_velocities(velocity: ArrayLike, starts: int, acceleration: Acceleration | None) -> np.ndarray:
    """A copy of V_r for each start, (start,), if it lies in [0, 1[ and an acceleration can reach it."""
    v = np.array(velocity, dtype=float)
    if not ((v >= 0) & (v < 1)).all():
        raise InputError(f"velocity = {velocity}; expected 0 <= V < 1, a fraction of the protraction velocity V_p")
    if acceleration and not (v >= acceleration.start).all():
        raise InputError(f"velocity = {velocity}; expected at least V_r(0) = {acceleration.start} when accelerating")
    if v.shape not in ((), (starts,)):
        raise InputError(f"velocities have the shape {v.shape}; expected one number or ({starts},), one a start")
    return np.broadcast_to(v, starts).copy()


def _settings(
    model: Model, network: Network, acceleration: Acceleration | None
) -> tuple[float, float, int, np.ndarray, np.ndarray]:
    """V_r(0), a, the order of updates, weights and constants, as the kernel reads them."""
    v_start, rate = (acceleration.start, acceleration.rate) if acceleration else (0.0, 0.0)
    w, d, g = weights(model), np.arange(6), network.geometry
    table = [(w.p1, _REAR), (w.p1, _CONTRA), (w.p2, _REAR), (w.p4, _FRONT)]
    table += [(p, source) for source in (_FRONT, _CONTRA) for p in (w.p31, w.p32, w.p33, w.p34)]
    p = np.concatenate([matrix[d, source] for matrix, source in table])
    k = np.concatenate([[network.aep0, network.pep0, network.pep_min, network.dt], g.origin, 1 / np.abs(g.y)])
    return v_start, rate, ORDERS.index(network.order), p, k


def _blocks(
    starts: np.ndarray, velocity: np.ndarray, steps: np.ndarray, network: Network, acceleration: Acceleration | None
) -> np.ndarray:
    """The starts at time 0, (block, row of lanes); empty lanes at the end have no steps to take."""
    size = len(starts)
    lanes = np.zeros((-(-size // LANES) * LANES, _ROWS))

    def rows(first: int, count: int = 1) -> slice:
        return slice(first // LANES, first // LANES + count)

    lanes[:size, rows(_X, 6)] = starts
    lanes[:, rows(_S, 6)] = lanes[:, rows(_S_OLD, 6)] = 1.0
    lanes[:, rows(_AEP, 6)] = network.aep0
    lanes[:size, rows(_V)] = (np.full(size, acceleration.start) if acceleration else velocity)[:, None]
    lanes[:size, rows(_V_TARGET)] = velocity[:, None]
    lanes[:size, rows(_STEPS)] = steps[:, None]
    return np.ascontiguousarray(lanes.reshape(-1, LANES, _ROWS).transpose(0, 2, 1)).reshape(-1, _ROWS * LANES)
