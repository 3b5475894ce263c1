"""The paper's claims, read from `claims.toml`, and the rules that judge them."""

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

TABLE = Path(__file__).with_name("claims.toml")  # the claims and their rules

LEVEL = 0.05
"""Significance level: two counts differ if p of Fisher's exact test is smaller."""

END = 0.05
"""Tolerance [V_p] within which measured velocities must reach both ends of a rule's range."""


@dataclass(frozen=True)
class Answer:
    """Our value, 95 % interval and verdict at the point that is farthest from agreeing with a rule."""

    value: float
    low: float
    high: float
    where: str
    agrees: bool


@dataclass(frozen=True)
class Rule:
    """Base class of rules: they judge a quantity over a range of velocities, whose ends must be measured."""

    quantity: Quantity
    velocities: tuple[float, float]

    def judged(self, points: list[Point]) -> Answer:
        """Return the answer of the rule to the points in its range of velocities."""
        raise NotImplementedError

    def answer(self, measured: Measured, observation_time: str) -> Answer | None:
        """Return the answer of the rule to measurements; None if a weight set has not been searched yet."""
        low, high = self.velocities
        points = self.quantity.points(measured, observation_time)
        inside = [point for point in points if low - 1e-9 <= point.velocity <= high + 1e-9]
        found = [point.velocity for point in inside]
        if not found or min(found) > low + END + 1e-9 or max(found) < high - END - 1e-9:
            return None
        return self.judged(inside)


@dataclass(frozen=True)
class Band(Rule):
    """Agrees if the 95 % interval of a quantity overlaps a band at every velocity of a range."""

    least: float = -np.inf
    most: float = np.inf
    over: Literal["each", "mean", "changes"] = "each"
    """What the rule judges: the value at each velocity; the mean over the range, J_N of Eq. 10 on a grid of velocities;
    or the changes from each velocity to the next (least = 0: they must rise, most = 0: they must fall)."""

    def judged(self, points: list[Point]) -> Answer:
        """Return the answer to the points, their mean or their changes, as `over` says."""
        if self.over == "mean":
            of_each_start = np.mean([point.values for point in points], axis=0)
            points = [Point(points[0].velocity, f"mean to {points[-1].velocity:g}", of_each_start)]
        estimates = [point.estimate for point in points]
        if self.over == "changes":
            names = dict.fromkeys(point.of for point in points)
            series = ([point for point in points if point.of == name] for name in names)
            estimates = [_change(*both) for pair in series for both in pairwise(pair)]
        excess = [max(item.value - self.most, self.least - item.value) for item in estimates]
        return _worst(estimates, excess, all(item.low <= self.most and item.high >= self.least for item in estimates))


@dataclass(frozen=True)
class Seen(Rule):
    """Agrees if Fisher's exact test finds no difference between our count and the paper's at every velocity.

    The two-sided test at the 5 % level is also valid for rare events and small samples.
    """

    count: int
    """Number of the paper's starts in which the event of the quantity occurred."""
    of: int
    """Number of all starts in the paper's sample."""

    def judged(self, points: list[Point]) -> Answer:
        """Return the answer to the counts of our starts."""
        p = [fisher(int(item.values.sum()), len(item.values), self.count, self.of) for item in points]
        estimates = [point.estimate for point in points]
        off = [abs(item.value - self.count / self.of) for item in estimates]
        return _worst(estimates, [(a < LEVEL) + b for a, b in zip(p, off, strict=True)], min(p) >= LEVEL)


def fisher(count: int, size: int, other: int, of: int) -> float:
    """Return p of Fisher's two-sided exact test that compares `count` of `size` with `other` of `of`; 0 if size = 0."""
    from scipy.stats import fisher_exact

    return float(fisher_exact([[count, size - count], [other, of - other]]).pvalue) if size else 0.0


def _worst(estimates: Sequence[Estimate], excess: Sequence[float], agrees: bool) -> Answer:
    """Return the answer at the first estimate with the largest `excess`, its distance from what the rule allows."""
    return Answer(*estimates[int(np.argmax(np.nan_to_num(excess, nan=np.inf)))], agrees)


def _change(first: Point, second: Point) -> Estimate:
    """Return the change of the mean between two points, with its 95 % interval for independent samples."""
    (a, a_low, a_high, where), (b, b_low, b_high, _) = first.estimate, second.estimate
    below, above = float(np.hypot(b - b_low, a_high - a)), float(np.hypot(b_high - b, a - a_low))
    return Estimate(b - a, b - a - below, b - a + above, f"{where} to {second.velocity:g}")


RULES: dict[str, Any] = {"band": Band, "seen": Seen}
"""Name of each kind of rule in `claims.toml` -> its class."""


@dataclass(frozen=True)
class Claim:
    """A number or statement of the paper; the head of `claims.toml` explains the fields."""

    key: str
    section: str
    text: str
    value: str
    rule: Rule
    calibrates: tuple[str, ...] = ()
    why: str = ""
    judged_by: str = ""
    """Quantity and rule with their fields, as text."""

    @property
    def kind(self) -> str:
        """'calibrated' if a constant of hexmj was inferred from the claim's number, else 'held out'."""
        return "calibrated" if self.calibrates else "held out"

    def answers(self, measured: Measured) -> dict[str, Answer | None]:
        """Return the answer for each observation time; gaits depend on none and have one answer with the key ''."""
        times = OBSERVATION_TIMES if self.rule.quantity.windowed else ("",)
        return {time: self.rule.answer(measured, time) for time in times}


@cache
def claims() -> dict[str, Claim]:
    """Return all claims by key, in the paper's order."""
    return {entry["key"]: _read(entry) for entry in read_toml(TABLE)["claim"]}


def _read(entry: dict[str, Any]) -> Claim:
    quantity, rule, calibrates = entry.pop("quantity"), entry.pop("rule"), tuple(entry.pop("calibrates", ()))
    judged_by = f"{_text(**quantity)}; {_text(**rule)}"
    measured = QUANTITIES[quantity.pop("kind")](**quantity)
    judge = RULES[rule.pop("kind")](measured, tuple(rule.pop("velocities")), **rule)
    return Claim(**entry, rule=judge, calibrates=calibrates, judged_by=judged_by)


def _text(kind: str, **members: Any) -> str:
    """Return a quantity or rule of `claims.toml` as text, such as "losses: curve = hws"."""
    return f"{kind}: {', '.join(f'{name} = {value}' for name, value in members.items())}"
