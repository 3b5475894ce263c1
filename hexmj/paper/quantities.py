"""What the paper's claims are about, looked up in measurements: one number for every start, at each velocity.

Two curves of FLSS are compared on the same starts.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hexmj.controllers.cruse1998 import ModelVariant
from hexmj.paper.found_sets import PRINTED, found_sets
from hexmj.paper.measurements import NO_SET
from hexmj.phases import CONTRALATERAL, IPSILATERAL, GaitName, circular_range, classify, unrolled, wilson_phase
from hexmj.stats import WILSON_Z, wilson_interval

if TYPE_CHECKING:
    import xarray as xr

Measured = Mapping[str, "xr.Dataset"]
"""Measurements of `hexmj.paper.protocol` by name, each with a leading velocity axis."""

PEAK = 0.05
"""Half the width of a narrow peak of phases."""


@dataclass(frozen=True)
class Point:
    """One quantity at one velocity."""

    velocity: float
    of: str
    """The pair of legs, if there are several points at a velocity."""
    values: np.ndarray
    """(start,)"""

    @property
    def estimate(self) -> tuple[float, float, float]:
        """Mean and 95 % interval: Wilson's for frequencies, else the normal one; all NaN without a start."""
        n = len(self.values)
        if n == 0:
            return np.nan, np.nan, np.nan
        mean = float(self.values.mean())
        if self.values.dtype == bool:
            return mean, *wilson_interval(int(self.values.sum()), n)
        half = WILSON_Z * float(self.values.std(ddof=1)) / np.sqrt(n) if n > 1 else 0.0
        return mean, mean - half, mean + half


@dataclass(frozen=True)
class Lost:
    """FLSS of a curve, or its difference from a multiple of another one's."""

    curve: str
    minus: str | None = None
    times: float = 1.0
    at: float | None = None
    """Velocity of the other curve, the same unless given."""
    windowed = True

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        if self.minus is None:
            return f"FLSS({self.curve})"
        other = self.minus if self.at is None else f"{self.minus} at V = {self.at:g}"
        return f"FLSS({self.curve}) - {f'{self.times:g} ' if self.times != 1 else ''}FLSS({other})"

    @property
    def needs(self) -> tuple[str, ...]:
        """Measurements."""
        return (self.curve,) if self.minus is None else (self.curve, self.minus)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """Where all of its sets are known."""
        curves = [measured[name].lost.sel(observation_time=observation_time) for name in self.needs]
        for v in curves[0].velocity.values.tolist():
            other = v if self.at is None else self.at
            if other not in curves[-1].velocity:
                continue
            lost, *less = (one.sel(velocity=at).values for one, at in zip(curves, (v, other), strict=False))
            if all((one != NO_SET).all() for one in (lost, *less)):
                yield Point(v, "", lost - self.times * less[0] if less else lost.astype(bool))


@dataclass(frozen=True)
class _OfModel:
    """Base of the quantities of a preset's gaits, for which no observation time matters."""

    model: str
    windowed = False

    @property
    def needs(self) -> tuple[str, ...]:
        """Measurements."""
        return (f"{self.model} gaits",)


@dataclass(frozen=True)
class Phase(_OfModel):
    """Relative phases in the main peak of the accelerated gaits that are periodic and never lost static stability."""

    pairs: Literal["ipsilateral", "contralateral"]
    minus_wilson: bool = False

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        return f"{self.pairs} phase({self.model})" + (" - 1/(1 + V)" if self.minus_wilson else "")

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """One for each pair."""
        for v, one in kept_gaits(measured[self.needs[0]]):
            for pair in one.pair.values[IPSILATERAL if self.pairs == "ipsilateral" else CONTRALATERAL].tolist():
                phase = one.phase.sel(pair=pair).values
                shift = float(wilson_phase(v)) if self.minus_wilson else 0.0
                yield Point(v, pair, unrolled(phase[main_peak(phase)]) - shift)


@dataclass(frozen=True)
class Regime(_OfModel):
    """Part of all starts whose limit regime is not as said, without acceleration or with it."""

    fault: Literal["aperiodic", "unstable"]
    accelerated: bool = False

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        how = "with" if self.accelerated else "without"
        return f"part of starts that come {how} acceleration to an {self.fault} limit regime({self.model})"

    @property
    def needs(self) -> tuple[str, ...]:
        """Measurements."""
        return (f"{self.model} gaits" if self.accelerated else f"{self.model} regimes",)

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """One for each velocity."""
        for v in measured[self.needs[0]].velocity.values.tolist():
            one = measured[self.needs[0]].sel(velocity=v)
            yield Point(v, "", ~(one.periodic if self.fault == "aperiodic" else one.stable).values.astype(bool))


@dataclass(frozen=True)
class Scatter(_OfModel):
    """Spread of the accelerated gaits: of periods over legs, of phases over ipsilateral pairs or over starts."""

    of: Literal["periods", "pairs", "phases"]

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        if self.of == "periods":
            return f"(longest - shortest) / mean period of the legs({self.model})"
        if self.of == "pairs":
            return f"largest - smallest phase, on the circle, of the ipsilateral pairs({self.model})"
        return f"part of starts outside the main peak of a pair({self.model})"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """One for each velocity, or for each pair."""
        for v, one in kept_gaits(measured[self.needs[0]]):
            if self.of == "periods":
                yield Point(v, "", np.ptp(one.periods.values, axis=1) / one.periods.values.mean(axis=1))
                continue
            if self.of == "pairs":
                yield Point(v, "", circular_range(one.phase.values[:, IPSILATERAL]))
                continue
            for pair in one.pair.values.tolist():
                yield Point(v, pair, ~main_peak(one.phase.sel(pair=pair).values))


@dataclass(frozen=True)
class Named(_OfModel):
    """Part of the accelerated gaits that have a name."""

    name: GaitName

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        return f"part of gaits that are {self.name}({self.model})"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """One for each velocity; the left side and the front legs name the gait."""
        for v, one in kept_gaits(measured[self.needs[0]]):
            phases = one.phase.sel(pair=["1-2", "2-3", "1-4"]).values
            yield Point(v, "", np.array([classify(*three) == self.name for three in phases.tolist()], dtype=bool))


@dataclass(frozen=True)
class Weight:
    """A parameter of the sets optimised for one velocity each, or the ratio of two."""

    parameter: str
    over: str | None = None
    model_variant: ModelVariant = PRINTED
    """Under which the sets were searched."""
    windowed = True
    needs: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """For a rule's sentence."""
        return f"|{self.parameter} / {self.over}| of the ideal sets" if self.over else f"{self.parameter} of ideal sets"

    def points(self, measured: Measured, observation_time: str) -> Iterator[Point]:
        """One for each set."""
        for one in found_sets():
            if (
                one.observation_time == observation_time
                and one.low == one.high
                and one.controller.model_variant == self.model_variant
            ):
                value = getattr(one.controller.weights, self.parameter)
                if self.over:
                    with np.errstate(divide="ignore", invalid="ignore"):
                        value = abs(np.float64(value) / getattr(one.controller.weights, self.over))
                yield Point(one.low, "", np.array([value]))


Quantity = Lost | Phase | Regime | Scatter | Named | Weight


def kept_gaits(gaits: "xr.Dataset") -> Iterator[tuple[float, "xr.Dataset"]]:
    """At each velocity the starts that Section 5.3 takes: in a periodic regime, and stable all the way."""
    for v in gaits.velocity.values.tolist():
        one = gaits.sel(velocity=v)
        yield v, one.isel(start=np.flatnonzero(one.periodic & one.stable & ~one.lost))


def main_peak(phase: np.ndarray) -> np.ndarray:
    """Which phases, (start,), lie within `PEAK` of the one that has most of the others this close."""
    near = np.abs((phase[:, np.newaxis] - phase + 0.5) % 1.0 - 0.5) <= PEAK
    return near[near.sum(axis=1).argmax()] if len(phase) else np.zeros(0, dtype=bool)
