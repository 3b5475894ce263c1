"""The paper's claims, from the table of data `claims.toml`, and the rules by which they are judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hexmj.files import read_toml
from hexmj.paper.quantities import QUANTITIES, Estimate, Measured, Point, Quantity
from hexmj.timing import OBSERVATION_TIMES

TABLE = Path(__file__).with_name("claims.toml")

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
class Rule:
    """Base of the rules: a quantity over a range of velocities, whose ends must be measured."""

    quantity: Quantity
    velocities: tuple[float, float]

    @property
    def words(self) -> str:
        """The rule in words."""
        raise NotImplementedError

    def judged(self, points: list[Point]) -> Answer:
        """Judge the points of the range."""
        raise NotImplementedError

    @property
    def span(self) -> str:
        """The velocities in words."""
        low, high = self.velocities
        return f"V = {low:g}" if low == high else f"V in [{low:g}, {high:g}]"

    def answer(self, measured: Measured, observation_time: str) -> Answer | None:
        """Judge the quantity; None if a weight set has not been searched yet."""
        low, high = self.velocities
        points = self.quantity.points(measured, observation_time)
        inside = [point for point in points if low - 1e-9 <= point.velocity <= high + 1e-9]
        met = [point.velocity for point in inside]
        if not met or min(met) > low + END + 1e-9 or max(met) < high - END - 1e-9:
            return None
        return self.judged(inside)


@dataclass(frozen=True)
class Band(Rule):
    """Agrees if, at every velocity of a range, the interval of a quantity reaches into a band."""

    least: float = -np.inf
    most: float = np.inf
    over: Literal["each", "mean", "changes"] = "each"
    """Judge each velocity; the mean over the range, J_N of Eq. 10 with velocities on a grid; or the changes from each
    velocity to the next, which rise (least = 0) or sink (most = 0)."""

    @property
    def words(self) -> str:
        """The rule in words."""
        if self.over == "changes":
            change = f"from each V to the next, over {self.span}, the 95 % interval of the change of"
            return f"{change} {self.quantity.words} reaches {'above' if self.least == 0 else 'below'} 0"
        if self.least == self.most:
            band = f"reaches {self.least:g}"
        elif np.isinf(self.least):
            band = f"does not lie above {self.most:g}"
        elif np.isinf(self.most):
            band = f"does not lie below {self.least:g}"
        else:
            band = f"reaches into [{self.least:g}, {self.most:g}]"
        at = f"averaged over {self.span}," if self.over == "mean" else f"at {self.span}"
        return f"{at} the 95 % interval of {self.quantity.words} {band}"

    def judged(self, points: list[Point]) -> Answer:
        """Judge the points, their mean or their changes."""
        if self.over == "mean":
            of_each_start = np.mean([point.values for point in points], axis=0)
            points = [Point(points[0].velocity, f"mean to {points[-1].velocity:g}", of_each_start)]
        estimates = [point.estimate for point in points]
        if self.over == "changes":
            names = dict.fromkeys(point.of for point in points)
            series = ([point for point in points if point.of == name] for name in names)
            estimates = [_change(*both) for one in series for both in pairwise(one)]
        strain = [max(one.value - self.most, self.least - one.value) for one in estimates]
        return _worst(estimates, strain, all(one.low <= self.most and one.high >= self.least for one in estimates))


@dataclass(frozen=True)
class Seen(Rule):
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
            f"at {self.span} Fisher's test does not tell the {self.quantity.words} from {self.count} of"
            f" {self.of} starts, the paper's own sample (p >= {LEVEL:g})"
        )

    def judged(self, points: list[Point]) -> Answer:
        """Judge the counts."""
        p = [fisher(int(one.values.sum()), len(one.values), self.count, self.of) for one in points]
        estimates = [point.estimate for point in points]
        off = [abs(one.value - self.count / self.of) for one in estimates]
        return _worst(estimates, [(a < LEVEL) + b for a, b in zip(p, off, strict=True)], min(p) >= LEVEL)


def fisher(count: int, size: int, other: int, of: int) -> float:
    """Return p of Fisher's exact test, two-sided, of `count` in `size` against `other` in `of`; 0 without starts."""
    from scipy.stats import fisher_exact

    return float(fisher_exact([[count, size - count], [other, of - other]]).pvalue) if size else 0.0


def _worst(estimates: Sequence[Estimate], strain: Sequence[float], agrees: bool) -> Answer:
    """Return the answer at the first estimate that strains the rule most."""
    return Answer(*estimates[int(np.argmax(np.nan_to_num(strain, nan=np.inf)))], agrees)


def _change(one: Point, other: Point) -> Estimate:
    """Return the change of the mean and its 95 % interval, as of independent samples."""
    (a, a_low, a_high, where), (b, b_low, b_high, _) = one.estimate, other.estimate
    below, above = float(np.hypot(b - b_low, a_high - a)), float(np.hypot(b_high - b, a - a_low))
    return Estimate(b - a, b - a - below, b - a + above, f"{where} to {other.velocity:g}")


RULES: dict[str, Any] = {"band": Band, "seen": Seen}
"""Classes by their kind in `claims.toml`."""


@dataclass(frozen=True)
class Claim:
    """A number or statement of the paper; its fields are explained in `claims.toml`."""

    key: str
    section: str
    text: str
    value: str
    rule: Rule
    calibrates: tuple[str, ...] = ()
    why: str = ""

    @property
    def kind(self) -> str:
        """'calibrated' if a constant was inferred from the claim's number, else 'held out'."""
        return "calibrated" if self.calibrates else "held out"

    def answers(self, measured: Measured) -> dict[str, Answer | None]:
        """Return the answer under each observation time, or one answer under '' if it depends on none."""
        times = OBSERVATION_TIMES if self.rule.quantity.windowed else ("",)
        return {time: self.rule.answer(measured, time) for time in times}


@cache
def claims() -> dict[str, Claim]:
    """Return all claims by key, in the paper's order."""
    return {entry["key"]: _read(entry) for entry in read_toml(TABLE)["claim"]}


@cache
def in_physics() -> list[dict[str, str]]:
    """Return topic, command and text of what only physical walks can answer."""
    return read_toml(TABLE)["in_physics"]


def _read(entry: dict[str, Any]) -> Claim:
    quantity, rule, calibrates = entry.pop("quantity"), entry.pop("rule"), tuple(entry.pop("calibrates", ()))
    measured = QUANTITIES[quantity.pop("kind")](**quantity)
    judge = RULES[rule.pop("kind")](measured, tuple(rule.pop("velocities")), **rule)
    return Claim(**entry, rule=judge, calibrates=calibrates)
