"""The coordination network: Eq. 1-6 and 11 of the paper, for many starts at once.

One step goes from the states at t to those at t + dt with V_r(t).  A walk begins with Delta(0) = 0,
AEP(0) = AEP_0 and s(-dt) = s(0): conventions of ours, where the paper is silent.  The equations are in
`hexmj.lanes`, compiled; ``tests/plain_network.py`` holds them in their readable form.
"""

from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from hexmj import lanes
from hexmj.errors import InputError
from hexmj.parameters import Acceleration, Model, Network, Order, weights
from hexmj.threads import run_blocks, thread_count
from hexmj.walks import Walk

MOST_STEPS = 10**9
"""Longest walk [steps]; far beyond any use."""
ORDERS = get_args(Order)
"""Names of the orders of updates, in the kernel's numbers."""


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
        at_speed: bool = False,
        threads: int | None = None,
    ) -> None:
        """Put every start at time 0; the arguments are those of `walk`.

        With `at_speed` they walk at the final velocity at once, and an acceleration takes place only after `restart`.
        """
        self.network = network or Network()
        self.done = 0
        self._starts = checked_starts(starts, self.network)
        velocity = checked_velocities(velocity, len(self._starts), acceleration)
        self._settings = *_, k = _settings(model, self.network, acceleration)
        self._blocks = np.empty((-(-len(velocity) // lanes.LANES), lanes.ROWS * lanes.LANES))
        first_velocity = _first_velocity(velocity, None if at_speed else acceleration)
        lanes.begin_blocks(self._blocks, self._starts, first_velocity, velocity, k)
        self._restart_velocity = _first_velocity(velocity, acceleration)
        self._threads = threads

    def advance(self, steps: int) -> Walk:
        """The next `steps` steps of the walk."""
        shape = (steps, len(self._starts))
        velocity, x, stance = np.empty(shape), np.empty((*shape, 6)), np.empty((*shape, 6), dtype=bool)

        def work(begin: int, end: int) -> None:
            lanes.record(self._blocks, begin, end, *self._settings, velocity, x, stance)

        run_blocks(work, len(self._blocks), 1, self._threads)
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.network.dt
        geometry = self.network.geometry
        return Walk(time, velocity, x, np.broadcast_to(geometry.y, x.shape), stance, geometry)

    def first_losses(self, unseen: int, seen: int) -> np.ndarray:
        """Begin with `unseen` steps and go on by `seen` more.

        Returns:
            The first of the latter that is statically unstable, counted from time 0, (start,); 0 where none is.
        """

        def work(begin: int, end: int) -> None:
            lanes.lose(self._blocks, begin, end, unseen, seen, *self._settings)

        run_blocks(work, len(self._blocks), 1, self._threads)
        self.done += unseen + seen
        return self._read(lanes.LOST, 1)[:, 0]

    @property
    def tips(self) -> np.ndarray:
        """Where the tips are now, (start, leg) [mm]."""
        return self._read(lanes.X)

    @property
    def standing(self) -> np.ndarray:
        """Which legs retract now, (start, leg)."""
        return self._read(lanes.S) == 1.0

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Go on from other tips and states than the network's own, both (start, leg): as measured, or disturbed."""
        self._write(lanes.X, tips)
        self._write(lanes.S, standing)

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """Put some starts, (start,) of bool, at time 0 again, all legs standing at `tips`, (start, leg) [mm].

        With an acceleration they begin at its V_r(0) again.
        """
        legs = {lanes.X: tips, lanes.S: 1.0, lanes.S_OLD: 1.0, lanes.AEP: self.network.aep0}
        for row, values in (legs | {lanes.PEP_SHIFT: 0.0, lanes.AEP_SHIFT: 0.0}).items():
            self._write(row, np.where(which[:, None], values, self._read(row)))
        self.slow_down(which)

    def slow_down(self, which: np.ndarray) -> None:
        """Let some starts, (start,) of bool, begin at V_r(0) of the acceleration again, their legs as they are."""
        for row, values in {lanes.V: self._restart_velocity, lanes.DONE: 0.0}.items():
            self._write(row, np.where(which, values, self._read(row, 1).T).T, 1)

    def _read(self, row: int, rows: int = 6) -> np.ndarray:
        """A variable of every start, (start, leg), or (start, 1) with one row."""
        return self._rows(row, rows).transpose(0, 2, 1).reshape(-1, rows)[: len(self._starts)]

    def _write(self, row: int, values: np.ndarray, rows: int = 6) -> None:
        padded = np.concatenate([values, np.repeat(values[-1:], -len(values) % lanes.LANES, axis=0)])
        self._rows(row, rows)[:] = padded.reshape(-1, lanes.LANES, rows).transpose(0, 2, 1)

    def _rows(self, row: int, rows: int) -> np.ndarray:
        return self._blocks.reshape(len(self._blocks), lanes.ROWS, lanes.LANES)[:, row : row + rows]


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
    steps = steps_within(duration, network)
    if steps.shape not in ((), (len(starts),)):
        raise InputError(f"durations have the shape {steps.shape}; expected one number or ({len(starts)},)")
    steps = np.broadcast_to(steps, len(starts)).copy()
    settings = _settings(model, network, acceleration)
    first_velocity = _first_velocity(velocity, acceleration)
    lost = np.empty(len(starts))

    def work(begin: int, end: int) -> None:
        part = slice(begin, end)
        lanes.first_losses(starts[part], first_velocity[part], velocity[part], steps[part], *settings, lost[part])

    run_blocks(work, len(starts), max(8 * lanes.LANES, -(-len(starts) // (4 * thread_count(threads)))), threads)
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


def _first_velocity(velocity: np.ndarray, acceleration: Acceleration | None) -> np.ndarray:
    """V_r(0) of each start, (start,)."""
    return np.full(len(velocity), acceleration.start) if acceleration else velocity


def _settings(
    model: Model, network: Network, acceleration: Acceleration | None
) -> tuple[int, tuple[float, ...], tuple[float, ...]]:
    """The order of updates, weights and constants, as the kernel reads them."""
    w, d, g = weights(model), np.arange(6), network.geometry
    span = network.aep0 - network.pep_min
    table = [(w.p1, lanes.REAR), (w.p1, lanes.CONTRA), (span * w.p2, lanes.REAR), (w.p4, lanes.FRONT)]
    table += [(p, source) for source in (lanes.FRONT, lanes.CONTRA) for p in (w.p31, w.p32, w.p33, w.p34)]
    p = np.concatenate([matrix[d, source] for matrix, source in table])
    v_start, rate = (acceleration.start, acceleration.rate) if acceleration else (0.0, 0.0)
    k = np.concatenate(
        [[network.aep0, network.pep0, network.pep_min, network.dt, v_start, rate], g.origin, 1 / np.abs(g.y)]
    )
    return ORDERS.index(network.order), tuple(p.tolist()), tuple(k.tolist())
