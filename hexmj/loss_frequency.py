"""FLSS, the frequency of the loss of static stability (paper, Section 3): starts, windows, I_N and J_N."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.intervals import wilson_interval, wilson_intervals
from hexmj.network import first_loss
from hexmj.parameters import Acceleration, Model, Network, Symmetric
from hexmj.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.body import Body

WINDOWS = ("walk", "start")
SAMPLE = 1000
"""Starts of one sample of the paper's protocol; it takes seven of them."""

SLAB = 64 * SAMPLE
"""Starts that FLSS holds in memory at a time; only counts are kept of them."""

MOST_STARTS = 10**10
"""Most starts of one FLSS; on two cores they take hours to days."""

MOST_DRAWN = 10**8
"""Most starts in one array; their tips take 5 GB."""


def draw_starts(size: int, seed: int, network: Network | None = None) -> np.ndarray:
    """Starts drawn uniformly from S: all legs stand between PEP_0 and AEP_0 (Section 3).

    Returns:
        (start, leg) [mm].  The first k of n starts are the same for every n.
    """
    _check_draw(size, seed)
    if size > MOST_DRAWN:
        raise InputError(f"starts = {size}; expected at most {MOST_DRAWN} in one array")
    return np.concatenate(list(_slabs(size, seed, network or Network())))


def _slabs(size: int, seed: int, network: Network) -> Iterator[np.ndarray]:
    """The starts of `draw_starts`, (start, leg) [mm], a slab at a time."""
    rng = np.random.default_rng(seed)
    for first in range(0, size, SLAB):
        yield rng.uniform(network.pep0, network.aep0, (min(SLAB, size - first), 6))


def _check_draw(size: int, seed: int) -> None:
    """Refuse a number of starts or a seed that makes no sense."""
    if not (isinstance(size, int) and 1 <= size <= MOST_STARTS):
        raise InputError(f"starts = {size}; expected a whole number of at least 1 and at most {MOST_STARTS}")
    if not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"seed = {seed}; expected an integer of at least 0")


def observation_time(
    window: str | float, velocity: np.ndarray, network: Network, acceleration: Acceleration | None = None
) -> np.ndarray:
    """The time t of Eq. 7 for each velocity [time units], which the paper leaves open.

    'walk' is three periods of a single leg oscillator, 3 (AEP_0 - PEP_0) (1 + 1/V); 'start' is
    2 (AEP_0 - PEP_0) / V_p.  When accelerating, a named window is counted from the time at which V is
    reached; a number is always the whole time.
    """
    v = np.asarray(velocity, dtype=float)
    if not isinstance(window, str):
        return np.full(v.shape, float(window))
    if window not in WINDOWS:
        raise InputError(f"window = {window!r}; valid names: {', '.join(WINDOWS)}, or a number of time units")
    stride = network.aep0 - network.pep0
    if window == "walk" and not (v > 0).all():
        raise InputError("velocity = 0 has no period; expected V > 0 with the window 'walk'")
    time = 3.0 * stride * (1.0 + 1.0 / v) if window == "walk" else np.full(v.shape, 2.0 * stride)
    return time + (v - acceleration.start) / acceleration.rate if acceleration else time


def flss(
    model: Model,
    velocities: Sequence[float],
    *,
    starts: int = 7 * SAMPLE,
    window: str | float = "walk",
    seed: int = 0,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Kinematic FLSS, I_N^t of Eq. 9, at each velocity, over the same starts.

    Starts are drawn, walked and counted slab by slab; of 1000 starts 8 bytes a velocity are kept.  The time of
    every loss is had from `network.first_loss` of `draw_starts`.

    Args:
        model: coupling weights.
        velocities: V_r (when accelerating, its final value), each 0 <= V < 1.
        starts: N.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of the starts.
        network: the constants that the paper leaves out.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over velocities: `flss`, its interval `low`, `high`, the standard deviation `sample_sd` over samples
        of 1000 starts, and the observation time `duration`.
    """
    network = network or Network()
    v = checked_list(velocities)
    _check_draw(starts, seed)
    duration = observation_time(window, v, network, acceleration)
    counts = []
    for x in _slabs(starts, seed, network):
        lost = np.empty((len(v), len(x)), dtype=bool)
        for i, one in enumerate(v):
            times = first_loss(x, model, one, duration[i], network=network, acceleration=acceleration, threads=threads)
            lost[i] = np.isfinite(times)
            if progress:
                progress(len(x) / starts / len(v))
        counts.append(losses_by_sample(lost))
    return frequency_table(np.concatenate(counts, axis=1), starts, v, duration).assign_attrs(
        settings({"model": model}, window, starts, seed, network, acceleration)
    )


def flss_over_range(
    model: Model,
    low: float,
    high: float,
    *,
    starts: int = 7 * SAMPLE,
    window: str | float = "walk",
    seed: int = 0,
    network: Network | None = None,
    threads: int | None = None,
) -> tuple[float, tuple[float, float]]:
    """Kinematic FLSS over a range of velocities, J_N^t of Eq. 10: each start has one of its own.

    Args:
        model: coupling weights.
        low: least velocity of the range W, uniform, 0 <= V < 1.
        high: greatest velocity of the range W.
        starts: N.
        window: 'walk', 'start' or the observation time itself [time units]; the named ones follow each velocity.
        seed: of the starts and their velocities.
        network: the constants that the paper leaves out.
        threads: one per core unless given; the result does not depend on it.

    Returns:
        The frequency and its 95 % Wilson interval.

    Raises:
        InputError: a range, window, seed or number of starts that makes no sense.
    """
    network = network or Network()
    if not 0 <= low <= high < 1:
        raise InputError(f"velocity range {low} to {high}; expected 0 <= low <= high < 1")
    _check_draw(starts, seed)
    rng, count = np.random.default_rng([seed, 1]), 0
    for x in _slabs(starts, seed, network):
        v = rng.uniform(low, high, len(x))
        lost = first_loss(x, model, v, observation_time(window, v, network), network=network, threads=threads)
        count += int(np.isfinite(lost).sum())
    return count / starts, wilson_interval(count, starts)


def settings(
    models: Mapping[str, Model],
    window: str | float,
    starts: int,
    seed: int,
    network: Network,
    acceleration: Acceleration | None,
    body: "Body | None" = None,
) -> dict[str, Any]:
    """All that is needed to run a measure again, as plain numbers and texts; it stands in every result's `attrs`."""
    plain = {
        "weights": {
            name: asdict(m) if isinstance(m, Symmetric) else {k: v.tolist() for k, v in vars(m).items()}
            for name, m in models.items()
        },
        "window": window,
        "starts": starts,
        "seed": seed,
        "network": asdict(network),
        "acceleration": asdict(acceleration) if acceleration else None,
    }
    return plain | ({"body": asdict(body)} if body else {})


def checked_list(velocities: Sequence[float]) -> np.ndarray:
    """The velocities of a table, (velocity,), if there is at least one and none comes twice."""
    try:
        v = np.array(velocities, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"velocities = {velocities!r}; expected a list of numbers") from None
    if v.ndim != 1 or len(v) == 0 or len(np.unique(v)) != len(v):
        raise InputError(f"velocities = {velocities}; expected a list of at least one, and none of them twice")
    if not ((v >= 0) & (v < 1)).all():
        raise InputError(f"velocities = {v.tolist()}; expected 0 <= V < 1, fractions of V_p")
    return v


def losses_by_sample(lost: np.ndarray) -> np.ndarray:
    """Number of losses in each sample of 1000 starts, (velocity, sample), from (velocity, start)."""
    return np.add.reduceat(lost, np.arange(0, lost.shape[1], SAMPLE), axis=1, dtype=int)


def frequency_table(losses: np.ndarray, starts: int, velocities: np.ndarray, duration: np.ndarray) -> "xr.Dataset":
    """FLSS with its intervals, from the number of losses in each sample of `starts` starts, (velocity, sample)."""
    import xarray as xr

    total = losses.sum(axis=1)
    low, high = wilson_intervals(total, starts)
    samples = losses[:, : starts // SAMPLE] / SAMPLE
    spread = samples.std(axis=1, ddof=1) if samples.shape[1] > 1 else np.full(len(total), np.nan)
    unit = {"units": "1"}
    return xr.Dataset(
        {
            "flss": ("velocity", total / starts, unit | {"long_name": "frequency of the loss of static stability"}),
            "low": ("velocity", low, unit | {"long_name": "lower end of the 95 % Wilson interval"}),
            "high": ("velocity", high, unit | {"long_name": "upper end of the 95 % Wilson interval"}),
            "sample_sd": ("velocity", spread, unit | {"long_name": "standard deviation over samples of 1000 starts"}),
            "duration": ("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
        },
        coords={"velocity": ("velocity", velocities, {"units": "V_p", "long_name": "velocity V_r"})},
    )
