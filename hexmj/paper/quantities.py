"""Quantities of the paper's claims: one number for every start, at each velocity, from measurements.

Two curves of FLSS are compared on the same starts.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.controllers.cruse1998 import ModelVariant
from hexmj.paper.found_sets import PRINTED, found_sets
from hexmj.paper.measurements import NO_SET
from hexmj.phases import CONTRALATERAL, IPSILATERAL, GaitName, circular_range, classify, unrolled, wilson_phase
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


@dataclass(frozen=True)
class Point:
    """A quantity at one velocity."""

    velocity: float
    of: str
    """The pair of legs, if there are several points at a velocity."""
    values: np.ndarray
    """(start,)"""

    @property
    def estimate(self) -> tuple[float, float, float]:
        """Mean and 95 % interval: Wilson's for frequencies, else the normal one; NaN without starts."""
        n = len(self.values)
        if n == 0:
            return np.nan, np.nan, np.nan
        mean = float(self.values.mean())
        if self.values.dtype == bool:
            return mean, *wilson_interval(int(self.values.sum()), n)
        half = WILSON_Z * float(self.values.std(ddof=1)) / np.sqrt(n) if n > 1 else 0.0
        return mean, mean - half, mean + half


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
class _OfGaits:
    """Base of the quantities of a preset's accelerated gaits, which depend on no observation time."""

    model: str
    windowed = False

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return (f"{self.model} gaits",)


@dataclass(frozen=True)
class Phases(_OfGaits):
    """Relative phases in the main peak of the gaits that are periodic and never lost static stability."""

    pairs: Literal["ipsilateral", "contralateral"]
    minus_wilson: bool = False

    @property
    def words(self) -> str:
        """The quantity in words."""
        return f"{self.pairs} phase({self.model})" + (" - 1/(1 + V)" if self.minus_wilson else "")

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity and pair of legs."""
        for v, one in kept_gaits(measured.data[self.needs[0]]):
            for pair in one.pair.values[IPSILATERAL if self.pairs == "ipsilateral" else CONTRALATERAL].tolist():
                phase = one.phase.sel(pair=pair).values
                shift = float(wilson_phase(v)) if self.minus_wilson else 0.0
                yield Point(v, pair, unrolled(phase[main_peak(phase)]) - shift)


@dataclass(frozen=True)
class Faults(_OfGaits):
    """Part of all starts whose steady-state gait is aperiodic or unstable, without acceleration or with it."""

    fault: Literal["aperiodic", "unstable"]
    accelerated: bool = False

    @property
    def words(self) -> str:
        """The quantity in words."""
        how = "with" if self.accelerated else "without"
        return f"part of starts that come {how} acceleration to an {self.fault} limit regime({self.model})"

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return (f"{self.model} gaits" if self.accelerated else f"{self.model} regimes",)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity."""
        gaits = measured.data[self.needs[0]]
        for v in gaits.velocity.values.tolist():
            one = gaits.sel(velocity=v)
            yield Point(v, "", ~(one.periodic if self.fault == "aperiodic" else one.stable).values.astype(bool))


@dataclass(frozen=True)
class Scatter(_OfGaits):
    """Spread of the gaits: of periods over legs, of phases over ipsilateral pairs or over starts."""

    of: Literal["periods", "pairs", "phases"]

    @property
    def words(self) -> str:
        """The quantity in words."""
        words = {
            "periods": "(longest - shortest) / mean period of the legs",
            "pairs": "largest - smallest phase, on the circle, of the ipsilateral pairs",
            "phases": "part of starts outside the main peak of a pair",
        }
        return f"{words[self.of]}({self.model})"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity; of phases for each pair, too."""
        for v, one in kept_gaits(measured.data[self.needs[0]]):
            if self.of == "periods":
                yield Point(v, "", np.ptp(one.periods.values, axis=1) / one.periods.values.mean(axis=1))
            elif self.of == "pairs":
                yield Point(v, "", circular_range(one.phase.values[:, IPSILATERAL]))
            else:
                for pair in one.pair.values.tolist():
                    yield Point(v, pair, ~main_peak(one.phase.sel(pair=pair).values))


@dataclass(frozen=True)
class Gait(_OfGaits):
    """Part of the gaits that have a name; the phases of the left side and of the front legs decide."""

    name: GaitName

    @property
    def words(self) -> str:
        """The quantity in words."""
        return f"part of gaits that are {self.name}({self.model})"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Yield a point for each velocity."""
        for v, one in kept_gaits(measured.data[self.needs[0]]):
            phases = one.phase.sel(pair=["1-2", "2-3", "1-4"]).values
            yield Point(v, "", np.array([classify(*three) == self.name for three in phases.tolist()], dtype=bool))


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
        for one in found_sets():
            if one.place == (observation_time, one.low, one.low, measured.model_variant):
                value = getattr(one.controller.weights, self.parameter)
                if self.over:
                    with np.errstate(divide="ignore", invalid="ignore"):
                        value = abs(np.float64(value) / getattr(one.controller.weights, self.over))
                yield Point(one.low, "", np.array([value]))


Quantity = Losses | Phases | Faults | Scatter | Gait | Weight

QUANTITIES: dict[str, Any] = {
    "losses": Losses,
    "phases": Phases,
    "faults": Faults,
    "scatter": Scatter,
    "gait": Gait,
    "weight": Weight,
}
"""Classes by their kind in `claims.toml`."""


def kept_gaits(gaits: "xr.Dataset") -> "Iterator[tuple[float, xr.Dataset]]":
    """Yield at each velocity the starts that Section 5.3 takes: with a periodic gait, and stable all the way."""
    for v in gaits.velocity.values.tolist():
        one = gaits.sel(velocity=v)
        yield v, one.isel(start=np.flatnonzero(one.periodic & one.stable & ~one.lost))


def main_peak(phase: np.ndarray) -> np.ndarray:
    """Return which phases, (start,), lie within `PEAK` of the phase that has most of the others this close."""
    near = np.abs((phase[:, np.newaxis] - phase + 0.5) % 1.0 - 0.5) <= PEAK
    return near[near.sum(axis=1).argmax()] if len(phase) else np.zeros(0, dtype=bool)
