"""Rules of the paper's claims: a quantity, velocities, and a band, a count or a trend."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from hexmj.paper.quantities import Measured, Point, Quantity

Estimate = tuple[float, float, float]
"""A value and its 95 % interval."""

LEVEL = 0.05
"""Probability below which two counts are not of one frequency."""

END = 0.05
"""A range of velocities is covered if its ends are met this closely."""


@dataclass(frozen=True)
class Answer:
    """Our value with its 95 % interval, at the point that strains a rule most."""

    value: float
    low: float
    high: float
    where: str
    agrees: bool


@dataclass(frozen=True)
class _OverRange:
    """Base of the rules: a quantity over a range of velocities, whose ends must be measured."""

    quantity: Quantity
    velocities: tuple[float, float]

    def answer(self, measured: Measured, observation_time: str) -> Answer | None:
        """Judge the quantity; None if a weight set has not been searched yet."""
        low, high = self.velocities
        points = self.quantity.points(measured, observation_time)
        inside = [point for point in points if low - 1e-9 <= point.velocity <= high + 1e-9]
        met = [point.velocity for point in inside]
        if not met or min(met) > low + END + 1e-9 or max(met) < high - END - 1e-9:
            return None
        return self.judged(inside)

    def judged(self, points: list[Point]) -> Answer:
        """Judge the points of the range."""
        raise NotImplementedError


@dataclass(frozen=True)
class Band(_OverRange):
    """Agrees if, at every velocity of a range, the interval of a quantity reaches into a band."""

    least: float = -np.inf
    most: float = np.inf
    averaged: bool = False
    """Judge the mean over the range, J_N of Eq. 10 with velocities on a grid, instead of each velocity."""

    @property
    def words(self) -> str:
        """The rule in words."""
        if self.least == self.most:
            band = f"reaches {self.least:g}"
        elif np.isinf(self.least):
            band = f"does not lie above {self.most:g}"
        elif np.isinf(self.most):
            band = f"does not lie below {self.least:g}"
        else:
            band = f"reaches into [{self.least:g}, {self.most:g}]"
        at = f"averaged over {_range(self.velocities)}," if self.averaged else f"at {_range(self.velocities)}"
        return f"{at} the 95 % interval of {self.quantity.words} {band}"

    def judged(self, points: list[Point]) -> Answer:
        if self.averaged:
            of_each_start = np.mean([point.values for point in points], axis=0)
            points = [Point(points[0].velocity, f"mean to {points[-1].velocity:g}", of_each_start)]
        estimates = [(point.estimate, _where(point)) for point in points]
        strain = [max(value - self.most, self.least - value) for (value, _, _), _ in estimates]
        agrees = all(low <= self.most and high >= self.least for (_, low, high), _ in estimates)
        return _worst(estimates, strain, agrees)


@dataclass(frozen=True)
class Seen(_OverRange):
    """Agrees if, at every velocity of a range, our count and that of the paper's own sample may have one frequency.

    Fisher's exact test, two-sided, at 5 %, holds for rare events and small samples too.
    """

    count: int
    """Number of starts in which the paper saw it."""
    of: int
    """Number of all starts of the paper."""

    @property
    def words(self) -> str:
        """The rule in words."""
        return (
            f"at {_range(self.velocities)} Fisher's test does not tell the {self.quantity.words} from {self.count} of"
            f" {self.of} starts, the paper's own sample (p >= {LEVEL:g})"
        )

    def judged(self, points: list[Point]) -> Answer:
        p = [fisher(int(one.values.sum()), len(one.values), self.count, self.of) for one in points]
        estimates = [(point.estimate, _where(point)) for point in points]
        strain = [
            (one < LEVEL) + abs(value - self.count / self.of)
            for one, ((value, _, _), _) in zip(p, estimates, strict=True)
        ]
        return _worst(estimates, strain, min(p) >= LEVEL)


@dataclass(frozen=True)
class Trend(_OverRange):
    """Agrees if, from each velocity of a range to the next, the interval of the change reaches the right side of 0."""

    sign: Literal[1, -1]

    @property
    def words(self) -> str:
        """The rule in words."""
        side = "above" if self.sign > 0 else "below"
        return (
            f"from each V to the next, over {_range(self.velocities)}, the 95 % interval of the change of"
            f" {self.quantity.words} reaches {side} 0"
        )

    def judged(self, points: list[Point]) -> Answer:
        """Judge the changes; the one that fits least is shown."""
        steps = [
            (_difference(one, following), f"{_where(one)} to {following.velocity:g}")
            for name in dict.fromkeys(point.of for point in points)
            for one, following in pairwise(point for point in points if point.of == name)
        ]
        agrees = all((high if self.sign > 0 else -low) >= 0 for (_, low, high), _ in steps)
        return _worst(steps, [-self.sign * value for (value, _, _), _ in steps], agrees)


Rule = Band | Seen | Trend

RULES: dict[str, Any] = {"band": Band, "seen": Seen, "trend": Trend}
"""Classes by their kind in `claims.toml`."""


def fisher(count: int, size: int, other: int, of: int) -> float:
    """Return p of Fisher's exact test, two-sided, of `count` in `size` against `other` in `of`; 0 without starts."""
    from scipy.stats import fisher_exact

    if size == 0 or of == 0:
        return 0.0
    return float(fisher_exact([[count, size - count], [other, of - other]]).pvalue)


def _worst(estimates: Sequence[tuple[Estimate, str]], strain: Sequence[float], agrees: bool) -> Answer:
    """Return the answer at the first estimate, each with its place, that strains the rule most."""
    (value, low, high), where = estimates[int(np.argmax(np.nan_to_num(strain, nan=np.inf)))]
    return Answer(value, low, high, where, agrees)


def _difference(one: Point, other: Point) -> Estimate:
    """Return the change of the mean and its 95 % interval, as of independent samples."""
    (a, a_low, a_high), (b, b_low, b_high) = one.estimate, other.estimate
    return b - a, b - a - float(np.hypot(b - b_low, a_high - a)), b - a + float(np.hypot(b_high - b, a - a_low))


def _range(velocities: tuple[float, float]) -> str:
    low, high = velocities
    return f"V = {low:g}" if low == high else f"V in [{low:g}, {high:g}]"


def _where(point: Point) -> str:
    return f"V = {point.velocity:g}" + (f", {point.of}" if point.of else "")
