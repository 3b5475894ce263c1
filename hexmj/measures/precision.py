"""Frequencies to a wanted precision: physical walks from stratified starts, where they narrow the intervals most.

Planning is so fast that the plans of many starts are known before any body walks.  A start belongs to a stratum by what
its plan loses: nothing, static stability only, or dynamic stability at a number of velocities V_p around the actual
one, see `tipping`.  A plan that tips even at a much higher V_p nearly always makes the body fall, and one that keeps
static stability nearly never, so that walks are needed mainly in between (Neyman 1934, J. R. Stat. Soc. 97).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hexmj.measures.kinematic import dynamic_losses
from hexmj.measures.tables import WalkSettings, columns, frequency, over_start
from hexmj.starts import SAMPLE
from hexmj.stats import WILSON_Z

if TYPE_CHECKING:
    import xarray as xr

MEASURES = {
    "kinematic": "planned_loss",
    "dynamic": "dynamic_loss",
    "grounded": "grounded_loss",
    "carried": "carried_loss",
    "physical": "fall",
}
"""Measure -> outcome, the time of the event that the measure counts."""

PLANNED = 20 * SAMPLE
"""Number of planned starts, from which the weights of the strata are known."""

FACTORS = (0.5, 1.0, 2.0**0.5, 2.0, 4.0)
"""V_p of the pendulums that divide the starts into strata, as multiples of the actual V_p."""

STRATA = len(FACTORS) + 2
"""Number of strata."""

PILOT = 5
"""Number of walks in each stratum before any variance is known."""

ADDED = 0.5
"""Number of walks with and without the event that are added to those of a stratum when its variance is computed."""


def plan_table(walks: WalkSettings, threads: int | None = None) -> "xr.Dataset":
    """Return `planned_loss`, `dynamic_loss` [time units] and `stratum` of every start, over start."""
    how: Any = {"stride": walks.stride, "acceleration": walks.acceleration, "threads": threads}
    arguments, vp = (walks.starts, walks.controller, walks.velocity, walks.duration), walks.conditions.vp
    losses = [
        dynamic_losses(*arguments, conditions=replace(walks.conditions, vp=factor * vp), **how) for factor in FACTORS
    ]
    static, dynamic, _ = losses[FACTORS.index(1.0)]
    stratum = np.isfinite([static, *(found.dynamic for found in losses)]).sum(axis=0)
    units = {"planned_loss": "time unit", "dynamic_loss": "time unit"}
    return over_start({"planned_loss": static, "dynamic_loss": dynamic, "stratum": stratum}, units)


class Estimate(NamedTuple):
    """A frequency that is estimated from stratified walks."""

    value: float
    half: float
    """Half width of the 95 % interval."""
    spread: np.ndarray
    """(stratum,) standard deviation of the event in each stratum, times the share of the stratum."""
    shared: float
    """Variance that is due to the shares of the strata, which walks do not narrow."""

    def wanted(self, precision: float) -> np.ndarray:
        """Return the number of walks in each stratum that this half width needs (Neyman allocation), (stratum,)."""
        return np.ceil(self.spread * self.spread.sum() / ((precision / WILSON_Z) ** 2 - self.shared))


class StratifiedWalks:
    """The planned starts of one sample, and the outcomes of those that have walked."""

    def __init__(self, plan: "xr.Dataset") -> None:
        """Begin without walks; `plan` is the result of `plan_table`."""
        self._plan, self._stratum = plan, plan.stratum.values
        self._members = [np.flatnonzero(self._stratum == index) for index in range(STRATA)]
        self._share = np.array([len(some) for some in self._members]) / len(self._stratum)
        self._starts, self.batches = np.array([], dtype=int), list["xr.Dataset"]()

    @property
    def _walked(self) -> np.ndarray:
        """(stratum,) number of walks."""
        return np.bincount(self._stratum[self._starts], minlength=STRATA)

    def walk(self, starts: np.ndarray, outcomes: "xr.Dataset") -> None:
        """Add the outcomes of these starts, (n,), indices of the planned starts."""
        self._starts = np.concatenate([self._starts, starts])
        self.batches.append(outcomes)

    def _times(self, outcome: str) -> np.ndarray:
        """Return an outcome of all walks, (walk,)."""
        return np.concatenate([batch[outcome].values for batch in self.batches])

    def estimate(self, events: np.ndarray) -> Estimate:
        """Estimate the frequency of an event from whether it happens in each walk, (walk,)."""
        walked, happened = self._walked, np.bincount(self._stratum[self._starts], events, STRATA)
        used = walked > 0
        frequencies = happened / np.maximum(walked, 1)
        smooth = (happened + ADDED) / (walked + 2.0 * ADDED)  # so that no stratum is treated as certain
        value = float(self._share @ frequencies)
        spread = self._share * np.sqrt(smooth * (1.0 - smooth))
        shared = float(self._share @ (frequencies - value) ** 2) / len(self._stratum)
        variance = float((spread[used] ** 2 / walked[used]).sum()) + shared
        return Estimate(value, WILSON_Z * variance**0.5, spread, shared)

    def next_starts(self, narrowed: Mapping[str, str], precision: float) -> np.ndarray:
        """Return the starts that walk next, (n,), at most as many as have walked; none if all is precise.

        Args:
            narrowed: measures that must be precise -> their outcomes.
            precision: half width of the 95 % interval that is enough.
        """
        sizes, walked = np.array([len(some) for some in self._members]), self._walked
        wanted = self._wanted(narrowed, precision)
        while wanted.any() and (walked < sizes).any() and (np.minimum(wanted, sizes) <= walked).all():
            wanted = np.ceil(1.05 * wanted)  # other strata have more walks than their part
        more = np.maximum(np.minimum(wanted, sizes) - walked, 0.0)
        if (most := walked.sum()) and more.sum() > most:
            more = np.ceil(more * most / more.sum())
        ends = np.minimum(walked + more.astype(int), sizes)
        return np.sort(np.concatenate([some[a:b] for some, a, b in zip(self._members, walked, ends, strict=True)]))

    def left(self, narrowed: Mapping[str, str], precision: float) -> float:
        """Return the estimated number of walks that are still needed after the next ones."""
        missing = np.maximum(self._wanted(narrowed, precision) - self._walked, 0.0).sum()
        return max(0.0, missing - len(self.next_starts(narrowed, precision)))

    def _wanted(self, narrowed: Mapping[str, str], precision: float) -> np.ndarray:
        """Return the number of walks in each stratum, (stratum,), that all measures together need."""
        if not self.batches:
            return np.full(STRATA, PILOT)
        estimates = [self.estimate(np.isfinite(self._times(name))) for name in narrowed.values()]
        wide = [one.wanted(precision) for one in estimates if one.half > precision]
        return np.max(wide, axis=0) if wide else np.zeros(STRATA)

    def table(self) -> "xr.Dataset":
        """Return the outcomes and the weight of each walk over start, all frequencies, and the number of `walks`."""
        import xarray as xr

        table = xr.concat(self.batches, "start").assign_coords(start=self._starts)
        new: dict[str, Any] = {}
        for name, outcome in MEASURES.items():
            if outcome in self._plan:
                new |= frequency(name, np.isfinite(self._plan[outcome].values), ())
            else:
                value, half, *_ = self.estimate(np.isfinite(self._times(outcome)))
                new |= columns(name, (), *np.clip([value, value - half, value + half], 0.0, 1.0))
        for agreement, outcome in {"agreement": "planned_loss", "dynamic_agreement": "dynamic_loss"}.items():
            same = np.isfinite(self._times(outcome)) == np.isfinite(self._times("fall"))
            new[agreement] = self.estimate(same).value
        new["walks"] = len(self._starts)
        new["weight"] = "start", (self._share / np.maximum(self._walked, 1))[self._stratum[self._starts]]
        return table.assign(new).sortby("start")
