"""Steady-state gaits (paper, Section 5.3): their period, duty factors and relative phases.

A leg's cycle begins at its onset, when the leg is raised and protraction begins. The paper does not define how a gait
is detected: the onset, `TOLERANCE`, `STEPS` and `CYCLES` are our conventions.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexmj.controllers.planning import advanced, begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.phases import PAIRS, circular_mean
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Acceleration, Stride, steps_within
from hexmj.validate import number, whole
from hexmj.walks import Walk, part_of

TOLERANCE = 0.002
"""Maximum change of a leg's cycle or lag within a steady-state gait, as a fraction of the period; `STEPS` add to it."""

STEPS = 5
"""Number of time steps added to the tolerance of cycles and lags, since legs change state at whole steps only."""

CYCLES = 10
"""Minimum number of equal cycles of every leg in a steady-state gait; three may be equal before a gait has settled."""

FINE = Stride(dt=0.01)
"""Default stride of gaits, with the time step of Figs. 5 and 6."""

PART = 4096
"""Maximum number of steps of a walk that are held in memory at a time."""


@dataclass(frozen=True, eq=False, repr=False)
class Gait:
    """Steady-state gaits; a start that reaches none, for example because a leg never swings, has NaN."""

    period: np.ndarray
    """(start,) mean period of the legs [time units]."""
    periods: np.ndarray
    """(start, leg) period of each leg [time units]."""
    duty_factor: np.ndarray
    """(start, leg) fraction of its period for which a leg stands, over cycles with a swing as long as the last one."""
    phase: np.ndarray
    """(start, pair) relative phase Phi_{j-k} in [0, 1), pairs in the order of `PAIRS`."""
    reached: np.ndarray
    """(start,) onset of leg 1 at which the steady-state gait begins [time units]; inf without a steady-state gait."""
    periodic: np.ndarray
    """(start,) whether period and lags of all legs are constant until the walk ends, for at least `CYCLES` cycles."""
    stable: np.ndarray
    """(start,) whether the walk keeps static stability at its end: in the last period if the gait is periodic, else for
    `CYCLES` times the longest of the legs' last cycles, or during all known steps if a leg has no whole cycle."""

    def __repr__(self) -> str:
        known, line = self.periodic, f"Gait(of {len(self.periodic)}: periodic {int(self.periodic.sum())}"
        line += f", stable {int(self.stable.sum())}"
        if known.any():
            duty = self.duty_factor[known].mean()
            line += f"; period {self.period[known].mean():.4g} time units, duty factor {duty:.2f}"
        return f"{line})"


def gait(walk: Walk) -> Gait:
    """Return the gait of every start of a walk whose velocity is constant at its end.

    A leg that is raised in the first step has no onset in that step, since the state before it is unknown.

    Raises:
        InputError: the walk has fewer than two steps.
    """
    if len(walk.time) < 2:
        raise InputError(f"the walk has {len(walk.time)} steps; expected at least {CYCLES} periods of every leg")

    def upright(steps: int) -> np.ndarray:
        return walk_margin(part_of(walk, slice(-steps, None))) > 0

    return _gaits(*_changes(walk.stance), walk.time, walk.stance.shape[1], upright)


def steady_state_gait(
    controller: Controller,
    velocity: float,
    *,
    n_starts: int = 100,
    seed: int = 0,
    stride: Stride = FINE,
    acceleration: Acceleration | None = None,
    periods: int = 80,
    threads: int | None = None,
) -> Gait:
    """Return the gaits that a controller reaches from random starts, as in Figs. 5 and 6.

    Only the legs' changes of state and the stability of the last periods of a walk are kept in memory.

    Args:
        controller: controller that plans the walks.
        velocity: V_r, or its final value when accelerating, 0 < V < 1.
        n_starts: number of random starts.
        seed: seed of the random starts.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; None keeps the velocity constant.
        periods: number of cycles of every leg after the velocity is reached; slow walks of LDVS need the default.
        threads: number of threads, by default one per core; the result does not depend on it.
    """
    if not 0 < number("velocity", velocity) < 1:
        raise InputError(f"velocity = {velocity}; expected 0 < V < 1")
    whole("periods", periods, CYCLES + 2)
    plan = begin(controller, draw_starts(n_starts, seed, stride), velocity, stride, acceleration, threads)
    longest = (stride.aep0 - stride.pep_min) * (1.0 + 1.0 / velocity)  # from AEP_0 to PEP_min and back
    speeding = acceleration.duration(velocity) if acceleration else 0.0
    steps = int(steps_within(speeding + periods * longest, stride))
    tail = steps - int(steps_within((CYCLES + 1) * longest, stride))
    stance = np.ones((1, n_starts, 6), dtype=bool)
    changes, upright = [], []
    while plan.done < steps:
        done = plan.done
        part = advanced(plan, min(PART, (tail if done < tail else steps) - done))
        row, foot, down = _changes(np.concatenate([stance, part.stance]))
        changes.append((row + done, foot, down))
        stance = part.stance[-1:]
        if done >= tail:
            upright.append(walk_margin(part) > 0)
    time = np.arange(steps + 1) * stride.dt
    row, foot, down = (np.concatenate(column) for column in zip(*changes, strict=True))
    return _gaits(row, foot, down, time, n_starts, lambda steps: np.concatenate(upright))


def _changes(stance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all changes of `stance`, (step, start, leg), as arrays: row after it, 6 start + leg, and new state."""
    state = stance.reshape(len(stance), -1)
    row, foot = np.divmod(np.flatnonzero(state[1:] != state[:-1]), state.shape[1])
    return row + 1, foot, state[row + 1, foot]


def _gaits(
    row: np.ndarray,
    foot: np.ndarray,
    down: np.ndarray,
    time: np.ndarray,
    n_starts: int,
    upright: Callable[[int], np.ndarray],
) -> Gait:
    """Return the gaits of all starts.

    Args:
        row, foot, down: changes between swing and stance, as `_changes` returns them.
        time: times of all steps of the walk, (step,) [time units].
        n_starts: number of starts.
        upright: returns whether the walk is stable in the last n or more steps, (step, start), for a number n.
    """
    dt = float((time[-1] - time[0]) / (len(time) - 1))
    raised = _by_foot(row[~down], foot[~down], 6 * n_starts)
    lowered = _by_foot(row[down], foot[down], 6 * n_starts)
    periods, duty_factor = np.full((n_starts, 6), np.nan), np.full((n_starts, 6), np.nan)
    phase, reached = np.full((n_starts, len(PAIRS)), np.nan), np.full(n_starts, np.inf)
    judged = np.full(n_starts, np.inf)  # duration at the end of the walk for which stability is evaluated
    j, k = np.transpose(list(PAIRS.values()))
    for n in range(n_starts):
        legs = slice(6 * n, 6 * n + 6)
        begin, touch, end = time[_cycles(raised[legs], lowered[legs])]
        if len(begin):
            judged[n] = CYCLES * (end - begin)[-1].max()
        settled = _settled(begin, end, dt)
        if len(begin) - settled < CYCLES:
            continue
        due = time[[rows[-1] for rows in raised[legs]]] + (1.0 + TOLERANCE) * (end[-1, 0] - end[-2, 0]) + STEPS * dt
        if (due < time[-1]).any():
            continue  # a leg has stopped swinging
        begin, touch, end = begin[settled:], touch[settled:], end[settled:]
        span = end[-1] - begin[0]
        periods[n] = span / np.round(span / (end[-1] - begin[-1]))  # a leg raised together with leg 1 may skip a cycle
        swing = touch - begin
        settled = _like_the_last(np.abs(swing - swing[-1]) / periods[n], dt / periods[n].mean())
        duty_factor[n] = 1.0 - swing[settled:].mean(axis=0) / periods[n]
        phase[n] = circular_mean((begin[:, k] - begin[:, j]) / periods[n].mean(), axis=0)  # Phi_{j-k}
        reached[n] = begin[0, 0]
        judged[n] = periods[n].mean()
    steps = np.ceil(np.clip(judged / dt, 1, len(time))).astype(int)
    kept = upright(int(steps.max()))
    stable = np.array([bool(kept[-last:, start].all()) for start, last in enumerate(steps)])
    return Gait(periods.mean(axis=1), periods, duty_factor, phase, reached, np.isfinite(reached), stable)


def _by_foot(row: np.ndarray, foot: np.ndarray, feet: int) -> list[np.ndarray]:
    """Group rows, (change,), by their foot, (change,); return an array for each of the `feet` feet."""
    order = np.argsort(foot, kind="stable")
    return np.split(row[order], np.searchsorted(foot[order], np.arange(1, feet)))


def _cycles(raised: list[np.ndarray], lowered: list[np.ndarray]) -> np.ndarray:
    """Return the rows of onset, touchdown and next onset of every cycle and leg, (3, cycle, leg).

    Cycle n of a leg is its first cycle that begins together with or after cycle n of leg 1.
    """
    following = [np.searchsorted(r, raised[0]) for r in raised]
    whole = min(np.count_nonzero(i + 1 < len(r)) for i, r in zip(following, raised, strict=True))
    begin = [r[i[:whole]] for i, r in zip(following, raised, strict=True)]
    touch = [r[np.searchsorted(r, b)] for b, r in zip(begin, lowered, strict=True)]
    end = [r[i[:whole] + 1] for i, r in zip(following, raised, strict=True)]
    return np.stack([np.stack(rows, axis=-1) for rows in (begin, touch, end)])


def _settled(begin: np.ndarray, end: np.ndarray, resolution: float) -> int:
    """Return the first cycle from which periods and lags equal the last ones; `begin` and `end` are (cycle, leg)."""
    if len(begin) == 0:
        return 0
    length, lag = end - begin, begin - begin[:, :1]
    period = length[-1, 0]
    drift = (lag - lag[-1]) / period
    change = np.maximum(np.abs(length / period - 1.0), np.abs(drift - np.round(drift)))
    return _like_the_last(change, resolution / period)


def _like_the_last(change: np.ndarray, resolution: float) -> int:
    """Return the first cycle from which all cycles equal the last one within the tolerance.

    `change` is each cycle's difference from the last, (cycle, leg), and `resolution` the time step, both in periods."""
    unlike = np.flatnonzero(change.max(axis=1) > TOLERANCE + STEPS * resolution)
    return int(unlike[-1]) + 1 if len(unlike) else 0
