"""Quantities of the paper's claims, computed from measurements: a value for every start at each velocity.

The difference of two FLSS curves is computed start by start.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hexmj.controllers.cruse1998 import ModelVariant
from hexmj.paper.measurements import NO_SET
from hexmj.paper.protocol import PRINTED, found_sets
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_range, classify, unrolled, wilson_phase
from hexmj.stats import WILSON_Z, wilson_interval

if TYPE_CHECKING:
    import xarray as xr

PEAK = 0.05
"""Half the width of the main peak of phases, as a fraction of the circle."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements under one model variant."""

    data: "Mapping[str, xr.Dataset]"
    """Measurements by name, see `protocol.MEASUREMENTS`; the first axis is the velocity."""
    model_variant: ModelVariant = PRINTED


class Estimate(NamedTuple):
    """A value, its 95 % interval (low, high), and a text that says at which velocity and pair of legs it holds."""

    value: float
    low: float
    high: float
    where: str


@dataclass(frozen=True)
class Point:
    """Values of a quantity at one velocity."""

    velocity: float
    of: str
    """Pair of legs, or '' if the quantity does not depend on pairs."""
    values: np.ndarray
    """(start,) value for each start; bool for events that are counted."""

    @property
    def estimate(self) -> Estimate:
        """Mean over starts, with Wilson's interval for bool values, else the normal interval; NaN without starts."""
        n, where = len(self.values), f"V = {self.velocity:g}" + (f", {self.of}" if self.of else "")
        if n == 0:
            return Estimate(np.nan, np.nan, np.nan, where)
        mean = float(self.values.mean())
        if self.values.dtype == bool:
            return Estimate(mean, *wilson_interval(int(self.values.sum()), n), where)
        half = WILSON_Z * float(self.values.std(ddof=1)) / np.sqrt(n) if n > 1 else 0.0
        return Estimate(mean, mean - half, mean + half, where)


@dataclass(frozen=True)
class Losses:
    """FLSS of a measurement, `curve`, or its difference FLSS(curve) - times * FLSS(minus)."""

    curve: str
    minus: str | None = None
    times: float = 1.0
    at: float | None = None
    """Velocity of the measurement `minus`; None uses the velocity of `curve`."""
    windowed = True
    """Whether the quantity depends on the observation time."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measurements that the quantity needs."""
        return (self.curve,) if self.minus is None else (self.curve, self.minus)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity at which the weight sets of both curves have been searched."""
        curves = [measured.data[name].lost.sel(observation_time=observation_time) for name in self.needs]
        for v in curves[0].velocity.values.tolist():
            other = v if self.at is None else self.at
            if other not in curves[-1].velocity:
                continue
            lost, *less = (curve.sel(velocity=at).values for curve, at in zip(curves, (v, other), strict=False))
            if all((outcomes != NO_SET).all() for outcomes in (lost, *less)):
                yield Point(v, "", lost - self.times * less[0] if less else lost.astype(bool))


@dataclass(frozen=True)
class Gaits:
    """A property of the steady-state gaits of a preset, `model`; it does not depend on the observation time."""

    model: str
    what: str
    """Property, a key of `PROPERTIES`."""
    minus_wilson: bool = False
    """Whether the phase 1/(1 + V) of Wilson's model is subtracted."""
    windowed = False

    @property
    def needs(self) -> tuple[str, ...]:
        """Name of the measurement that the quantity needs, in a tuple."""
        return (f"{self.model} {PROPERTIES[self.what][0]}",)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity, or for each velocity and pair of legs if the property belongs to pairs."""
        gaits, values = measured.data[self.needs[0]], PROPERTIES[self.what][1]
        for v in gaits.velocity.values.tolist():
            shift = float(wilson_phase(v)) if self.minus_wilson else None
            for pair, numbers in values(gaits.sel(velocity=v)):
                yield Point(v, pair, numbers if shift is None else numbers - shift)


@dataclass(frozen=True)
class Weight:
    """A parameter of the ideal weight sets, or its absolute ratio to the parameter `over`, if that is given."""

    parameter: str
    over: str | None = None
    windowed = True
    needs: tuple[str, ...] = ()

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each ideal set that was found for the observation time and model variant."""
        for (time, low, high, variant), network in found_sets().items():
            if (time, high, variant) == (observation_time, low, measured.model_variant):
                value = getattr(network.weights, self.parameter)
                if self.over:
                    with np.errstate(divide="ignore", invalid="ignore"):
                        value = abs(np.float64(value) / getattr(network.weights, self.over))
                yield Point(low, "", np.array([value]))


Quantity = Losses | Gaits | Weight

QUANTITIES: dict[str, Any] = {"losses": Losses, "gaits": Gaits, "weight": Weight}
"""Name of each kind of quantity in `claims.toml` -> its class."""

Values = Iterable[tuple[str, np.ndarray]]
"""Items of a pair of legs, or '' for all legs, and the values of the starts, (start,)."""


def kept(gaits: "xr.Dataset") -> "xr.Dataset":
    """Return the gaits at one velocity that Section 5.3 considers: periodic, stable, and never unstable before."""
    return gaits.isel(start=np.flatnonzero(gaits.periodic & gaits.stable & ~gaits.lost))


def main_peak(phase: np.ndarray) -> np.ndarray:
    """Return which phases lie in the main peak, (start,): within `PEAK` of the phase with most phases so close."""
    near = np.abs((phase[:, np.newaxis] - phase + 0.5) % 1.0 - 0.5) <= PEAK
    return near[near.sum(axis=1).argmax()] if len(phase) else np.zeros(0, dtype=bool)


def _phases(gaits: "xr.Dataset", pairs: slice) -> Values:
    """Yield each pair and the phases of its main peak."""
    for pair in gaits.pair.values[pairs].tolist():
        phase = kept(gaits).phase.sel(pair=pair).values
        yield pair, unrolled(phase[main_peak(phase)])


def _outside(gaits: "xr.Dataset") -> Values:
    for pair in gaits.pair.values.tolist():
        yield pair, ~main_peak(kept(gaits).phase.sel(pair=pair).values)


def _range_of_periods(gaits: "xr.Dataset") -> Values:
    periods = kept(gaits).periods.values
    yield "", np.ptp(periods, axis=1) / periods.mean(axis=1)


def _positive_metachrony(gaits: "xr.Dataset") -> Values:
    """Yield whether each gait is positive metachrony, by the phases of the left legs and of the front legs."""
    phases = kept(gaits).phase.sel(pair=["1-2", "2-3", "1-4"]).values
    yield "", np.array([classify(*three) == "positive metachrony" for three in phases.tolist()], dtype=bool)


PROPERTIES: "dict[str, tuple[str, Callable[[xr.Dataset], Values]]]" = {
    "ipsilateral phase": ("gaits", partial(_phases, pairs=IPSILATERAL)),
    "contralateral phase": ("gaits", partial(_phases, pairs=CONTRALATERAL)),
    "(longest - shortest) / mean period of the legs": ("gaits", _range_of_periods),
    "largest - smallest phase, on the circle, of the ipsilateral pairs": (
        "gaits", lambda gaits: [("", circular_range(kept(gaits).phase.values[:, IPSILATERAL]))]),
    "part of starts outside the main peak of a pair": ("gaits", _outside),
    "part of gaits that are positive metachrony": ("gaits", _positive_metachrony),
    "part of starts that come with acceleration to an aperiodic limit regime": (
        "gaits", lambda gaits: [("", gaits.periodic.values == 0)]),
    "part of starts that come without acceleration to an unstable limit regime": (
        "regimes", lambda gaits: [("", gaits.stable.values == 0)]),
}  # fmt: skip
"""Name of each property of gaits -> kind of measurement, and a function of the gaits at one velocity."""
