"""The coordination network: Eq. 1-6 and 11 of the paper, compiled for many starts at once.

`LANES` starts lie side by side in a block, one row of lanes for each variable of each leg, and every
lane goes through the same operations without branches, so that the compiler fills the vector units.
``tests/plain_network.py`` holds the same equations in their readable form, start by start; both agree
to the last bit.

One step goes from the states at t to those at t + dt with V_r(t).  A walk begins with Delta(0) = 0,
AEP(0) = AEP_0 and s(-dt) = s(0): conventions of ours, where the paper is silent.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.legs import MIRROR, N2, N4
from hexmj.parameters import Acceleration, Model, Network, weights
from hexmj.threads import run_blocks
from hexmj.walks import Walk

LANES = 64
ORDERS = ("printed", "undelayed", "sequential")
_UNDELAYED, _SEQUENTIAL = 1, 2

# A leg without the neighbour in question names itself, with weight 0.
_REAR = tuple(n[0] if n else d for d, n in enumerate(N2))
_FRONT = tuple(n[0] if n else d for d, n in enumerate(N4))
_CONTRA = MIRROR

# Rows of lanes of a block.  Six rows a variable, one for each leg: the tip x, the states s(t) and
# s(t - dt), AEP(t), the influences on PEP and AEP that the next step uses, and those after them.
_X, _S, _S_OLD, _AEP, _PEP_SHIFT, _AEP_SHIFT, _PEP_NEXT, _AEP_NEXT = (6 * i * LANES for i in range(8))
# One row a variable: V_r(t) and its target, the number of steps, and the step of the first loss.
_V, _V_TARGET, _STEPS, _LOST = ((48 + i) * LANES for i in range(4))
_ROWS = 52

# The weights of each kind of neighbour in `_couplings`, six numbers each, one for each destination.
_P1_REAR, _P1_CONTRA, _P2_REAR, _P4_FRONT = 0, 6, 12, 18
_P31_FRONT, _P32_FRONT, _P33_FRONT, _P34_FRONT = 24, 30, 36, 42
_P31_CONTRA, _P32_CONTRA, _P33_CONTRA, _P34_CONTRA = 48, 54, 60, 66


@njit(nogil=True)
def _influence(z, d, j, v, p, k):
    """Eq. 2-4 for leg d in lane j: the sum of Delta^1, Delta^2 and Delta^3."""
    aep0, pep_min = k[0], k[2]
    rear, contra, front = _REAR[d] * LANES + j, _CONTRA[d] * LANES + j, _FRONT[d] * LANES + j
    s_rear, s_contra, s_front = z[_S + rear], z[_S + contra], z[_S + front]
    total = (s_rear - 1.0) * p[_P1_REAR + d] + (s_contra - 1.0) * p[_P1_CONTRA + d]  # Eq. 2
    total += (aep0 - pep_min) * p[_P2_REAR + d] * (s_rear * (1.0 - z[_S_OLD + rear]))  # Eq. 3
    ahead = p[_P31_FRONT + d] + p[_P34_FRONT + d] * v - z[_X + front]
    shift = (p[_P32_FRONT + d] if ahead >= 0.0 else p[_P33_FRONT + d]) * s_front * ahead
    total += shift if shift < 4.0 else 4.0  # Eq. 4
    ahead = p[_P31_CONTRA + d] + p[_P34_CONTRA + d] * v - z[_X + contra]
    shift = (p[_P32_CONTRA + d] if ahead >= 0.0 else p[_P33_CONTRA + d]) * s_contra * ahead
    total += shift if shift < 4.0 else 4.0  # Eq. 4
    return total


@njit(nogil=True)
def _target(z, d, j, p, k):
    """Eq. 5 for leg d in lane j: Delta^4."""
    i, front = d * LANES + j, _FRONT[d] * LANES + j
    crossed = k[4 + d] + z[_X + i] >= k[4 + _FRONT[d]] + z[_X + front]
    return (k[2] - z[_AEP + i]) * p[_P4_FRONT + d] if crossed else 0.0


@njit(nogil=True)
def _move(z, d, j, v, pep_shift, aep_shift, k):
    """Eq. 6 for leg d in lane j."""
    i = d * LANES + j
    aep0, pep0, pep_min, dt = k[0], k[1], k[2], k[3]
    s = z[_S + i]
    x = z[_X + i] - v * dt * s + dt * (1.0 - s)
    aep = aep0 + aep_shift
    pep = pep0 + pep_shift
    pep = pep if pep > pep_min else pep_min
    lands = 1.0 if x > aep else 0.0
    stays = 0.0 if x < pep else 1.0
    z[_X + i] = x
    z[_AEP + i] = aep
    z[_S_OLD + i] = s
    z[_S + i] = stays if s == 1.0 else lands


@njit(nogil=True)
def _step_together(z, order, p, k):
    """One step of a block, all six legs at once."""
    for j in range(LANES):
        v = z[_V + j]
        for d in range(6):
            i = d * LANES + j
            z[_PEP_NEXT + i] = _influence(z, d, j, v, p, k)
            z[_AEP_NEXT + i] = _target(z, d, j, p, k)
    pep_shift, aep_shift = (_PEP_NEXT, _AEP_NEXT) if order == _UNDELAYED else (_PEP_SHIFT, _AEP_SHIFT)
    for j in range(LANES):
        v = z[_V + j]
        for d in range(6):
            i = d * LANES + j
            _move(z, d, j, v, z[pep_shift + i], z[aep_shift + i], k)
            z[_PEP_SHIFT + i] = z[_PEP_NEXT + i]
            z[_AEP_SHIFT + i] = z[_AEP_NEXT + i]


@njit(nogil=True)
def _step_in_turn(z, p, k):
    """One step of a block, leg after leg."""
    for j in range(LANES):
        v = z[_V + j]
        for d in range(6):
            _move(z, d, j, v, _influence(z, d, j, v, p, k), _target(z, d, j, p, k), k)


@njit(nogil=True)
def _step(z, t, v_start, rate, order, p, k):
    """One step of a block, to time t; V_r(t) after it by Eq. 11."""
    if order == _SEQUENTIAL:
        _step_in_turn(z, p, k)
    else:
        _step_together(z, order, p, k)
    for j in range(LANES):
        z[_V + j] = v_start + rate * t if z[_V + j] < z[_V_TARGET + j] else z[_V_TARGET + j]  # Eq. 11


@njit(nogil=True)
def _mark_losses(z, n, k):
    """Note step n where a lane loses static stability for the first time; True while a lane is undecided.

    With u = x / |y| of the standing feet, the centre of mass lies strictly inside the support polygon
    if and only if both sides stand, max u left + max u right > 0 and min u left + min u right < 0.
    """
    undecided = 0.0
    for j in range(LANES):
        left_max = right_max = -np.inf
        left_min = right_min = np.inf
        for d in range(3):
            u = (k[4 + d] + z[_X + d * LANES + j]) * k[10 + d]
            high = u if z[_S + d * LANES + j] == 1.0 else -np.inf
            low = u if z[_S + d * LANES + j] == 1.0 else np.inf
            left_max = high if high > left_max else left_max
            left_min = low if low < left_min else left_min
        for d in range(3, 6):
            u = (k[4 + d] + z[_X + d * LANES + j]) * k[10 + d]
            high = u if z[_S + d * LANES + j] == 1.0 else -np.inf
            low = u if z[_S + d * LANES + j] == 1.0 else np.inf
            right_max = high if high > right_max else right_max
            right_min = low if low < right_min else right_min
        unstable = (left_max + right_max <= 0.0) | (left_min + right_min >= 0.0)
        lost = n if unstable & (z[_LOST + j] == 0.0) & (n <= z[_STEPS + j]) else z[_LOST + j]
        z[_LOST + j] = lost
        undecided = max(undecided, 1.0 if (lost == 0.0) & (n < z[_STEPS + j]) else 0.0)
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
    if not (np.isfinite(duration).all() and (duration >= network.dt).all()):
        raise InputError(f"duration = {duration}; expected a finite time of at least one step, {network.dt} time units")
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
