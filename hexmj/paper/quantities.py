"""Quantities of the paper's claims: one number for every start, at each velocity, from measurements.

Two curves of FLSS are compared on the same starts.
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
"""Half the width of a narrow peak of phases."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured under one model variant."""

    data: "Mapping[str, xr.Dataset]"
    """Measurements by name, see `protocol.MEASUREMENTS`; the first axis is the velocity."""
    model_variant: ModelVariant = PRINTED


class Estimate(NamedTuple):
    """A value with its 95 % interval, and where it was measured."""

    value: float
    low: float
    high: float
    where: str


@dataclass(frozen=True)
class Point:
    """A quantity at one velocity."""

    velocity: float
    of: str
    """The pair of legs, if there are several points at a velocity."""
    values: np.ndarray
    """(start,)"""

    @property
    def estimate(self) -> Estimate:
        """The mean, with Wilson's interval for frequencies, else the normal one; NaN without starts."""
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
    """FLSS of a curve, or its difference from a multiple of another curve's."""

    curve: str
    minus: str | None = None
    times: float = 1.0
    at: float | None = None
    """Velocity of the other curve; by default the same."""
    windowed = True
    """Whether the quantity depends on the observation time."""

    @property
    def words(self) -> str:
        """The quantity in words."""
        if self.minus is None:
            return f"FLSS({self.curve})"
        other = self.minus if self.at is None else f"{self.minus} at V = {self.at:g}"
        return f"FLSS({self.curve}) - {f'{self.times:g} ' if self.times != 1 else ''}FLSS({other})"

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return (self.curve,) if self.minus is None else (self.curve, self.minus)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity at which all weight sets are known."""
        curves = [measured.data[name].lost.sel(observation_time=observation_time) for name in self.needs]
        for v in curves[0].velocity.values.tolist():
            other = v if self.at is None else self.at
            if other not in curves[-1].velocity:
                continue
            lost, *less = (one.sel(velocity=at).values for one, at in zip(curves, (v, other), strict=False))
            if all((one != NO_SET).all() for one in (lost, *less)):
                yield Point(v, "", lost - self.times * less[0] if less else lost.astype(bool))


@dataclass(frozen=True)
class Gaits:
    """A property of a preset's steady-state gaits, which depends on no observation time."""

    model: str
    what: str
    """A key of `PROPERTIES`."""
    minus_wilson: bool = False
    """Subtract the phase 1/(1 + V) of Wilson's model."""
    windowed = False

    @property
    def words(self) -> str:
        """The quantity in words."""
        return f"{self.what}({self.model})" + (" - 1/(1 + V)" if self.minus_wilson else "")

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return (f"{self.model} {PROPERTIES[self.what][0]}",)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity, and for each pair of legs if the property is one of pairs."""
        gaits, values = measured.data[self.needs[0]], PROPERTIES[self.what][1]
        for v in gaits.velocity.values.tolist():
            shift = float(wilson_phase(v)) if self.minus_wilson else None
            for pair, numbers in values(gaits.sel(velocity=v)):
                yield Point(v, pair, numbers if shift is None else numbers - shift)


@dataclass(frozen=True)
class Weight:
    """A parameter of the weight sets that were found for one velocity each, or the ratio of two parameters."""

    parameter: str
    over: str | None = None
    windowed = True
    needs: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The quantity in words."""
        return f"|{self.parameter} / {self.over}| of the ideal sets" if self.over else f"{self.parameter} of ideal sets"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each set that was found under the model variant."""
        for (time, low, high, variant), network in found_sets().items():
            if (time, high, variant) == (observation_time, low, measured.model_variant):
                value = getattr(network.weights, self.parameter)
                if self.over:
                    with np.errstate(divide="ignore", invalid="ignore"):
                        value = abs(np.float64(value) / getattr(network.weights, self.over))
                yield Point(low, "", np.array([value]))


Quantity = Losses | Gaits | Weight

QUANTITIES: dict[str, Any] = {"losses": Losses, "gaits": Gaits, "weight": Weight}
"""Classes by their kind in `claims.toml`."""

Values = Iterable[tuple[str, np.ndarray]]
"""Pairs of legs, or an empty text for all legs, each with the values of all starts, (start,)."""


def kept(gaits: "xr.Dataset") -> "xr.Dataset":
    """Return the starts that Section 5.3 takes, at one velocity: with a periodic gait, and stable all the way."""
    return gaits.isel(start=np.flatnonzero(gaits.periodic & gaits.stable & ~gaits.lost))


def main_peak(phase: np.ndarray) -> np.ndarray:
    """Return which phases, (start,), lie within `PEAK` of the phase that has most of the others this close."""
    near = np.abs((phase[:, np.newaxis] - phase + 0.5) % 1.0 - 0.5) <= PEAK
    return near[near.sum(axis=1).argmax()] if len(phase) else np.zeros(0, dtype=bool)


def _phases(gaits: "xr.Dataset", pairs: slice) -> Values:
    """Yield the phases of each pair in its main peak."""
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
    """Yield which gaits have this name; the phases of the left side and of the front legs decide."""
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
"""Properties of `Gaits`, each with its measurement, and its values in the gaits of one velocity."""
