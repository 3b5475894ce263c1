"""Frequencies to a wanted precision: physical walks from stratified starts, where they narrow the interval most.

Planning is so fast that the plans of many starts are known before any body walks.  A start belongs to a stratum by what
its plan loses: no stability, static stability only, or dynamic stability at a number of velocities V_p around the
actual one, see `tipping`.  A plan that tips even at a much higher V_p nearly always makes the body fall, one that keeps
static stability nearly never, so that walks are needed mainly in between (Neyman 1934, J. R. Stat. Soc. 97).
"""

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hexmj.measures.kinematic import dynamic_losses
from hexmj.measures.tables import WalkSettings, over_start
from hexmj.starts import SAMPLE
from hexmj.stats import WILSON_Z

if TYPE_CHECKING:
    import xarray as xr

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
    how = {"stride": walks.stride, "acceleration": walks.acceleration, "threads": threads}
    arguments = walks.starts, walks.controller, walks.velocity, walks.duration
    conditions, stratum = walks.conditions, np.zeros(walks.n_starts, dtype=int)
    planned, dynamic = np.array([]), np.array([])
    for factor in FACTORS:
        losses = dynamic_losses(*arguments, conditions=replace(conditions, vp=factor * conditions.vp), **how)
        stratum += np.isfinite(losses.dynamic)
        if factor == 1.0:
            planned, dynamic = losses.static, losses.dynamic
    stratum += np.isfinite(planned)
    units = {"planned_loss": "time unit", "dynamic_loss": "time unit"}
    return over_start({"planned_loss": planned, "dynamic_loss": dynamic, "stratum": stratum}, units)


class Estimate(NamedTuple):
    """A frequency that is estimated from stratified walks."""

    value: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    """Upper end of the 95 % interval."""
    plain: float
    """Number of walks from random starts that would give an interval of this width."""
    wanted: np.ndarray
    """(stratum,) number of walks that a narrower interval needs, from `StratifiedWalks.estimate`."""


class StratifiedWalks:
    """The planned starts of one sample, and which of them have walked."""

    def __init__(self, stratum: np.ndarray) -> None:
        """Begin with the stratum of each planned start, (start,), and without walks."""
        self._stratum = stratum
        self._share = np.bincount(stratum, minlength=STRATA) / len(stratum)
        self._walked = np.zeros(STRATA, dtype=int)
        self.starts = np.array([], dtype=int)
        """Indices of the starts that have walked."""

    @property
    def weight(self) -> np.ndarray:
        """Weight of each walk in means over all starts, in the order of `starts`; the weights add up to 1."""
        known = np.where(self._walked > 0, self._share, 0.0)
        each = known / known.sum() / np.maximum(self._walked, 1)
        return each[self._stratum[self.starts]]

    def walk(self, which: np.ndarray) -> None:
        """Note that these starts, (n,), have walked."""
        self.starts = np.concatenate([self.starts, which])
        self._walked += np.bincount(self._stratum[which], minlength=STRATA)

    def estimate(self, events: np.ndarray, precision: float) -> Estimate:
        """Estimate the frequency of an event, 0 or 1 for each walk, and the walks that a half width needs."""
        used = self._walked > 0
        happened = np.bincount(self._stratum[self.starts], events, STRATA)
        frequency = happened / np.maximum(self._walked, 1)
        smooth = (happened + ADDED) / (self._walked + 2.0 * ADDED)  # so that no stratum is treated as certain
        spread = self._share * np.sqrt(smooth * (1.0 - smooth))
        value, smooth_share = float(self._share @ frequency), float(self._share @ smooth)
        variance = float((spread[used] ** 2 / self._walked[used]).sum())
        variance += float(self._share @ (frequency - value) ** 2) / len(self._stratum)  # of the strata's weights
        half = WILSON_Z * variance**0.5
        wanted = np.ceil(spread * spread.sum() * (WILSON_Z / precision) ** 2)  # Neyman allocation
        plain = float(smooth_share * (1.0 - smooth_share)) / variance
        return Estimate(value, max(0.0, value - half), min(1.0, value + half), plain, wanted)

    def next_starts(self, wanted: np.ndarray) -> np.ndarray:
        """Return the starts that walk next towards `wanted` walks in each stratum, at most as many as have walked."""
        members = [np.flatnonzero(self._stratum == index) for index in range(STRATA)]
        sizes = np.array([len(some) for some in members])
        more = np.maximum(np.minimum(wanted, sizes) - self._walked, 0.0)
        if (most := self._walked.sum()) and more.sum() > most:
            more = np.ceil(more * most / more.sum())
        ends = np.minimum(self._walked + more.astype(int), sizes)
        parts = [some[begin:end] for some, begin, end in zip(members, self._walked, ends, strict=True)]
        return np.sort(np.concatenate(parts))

    def pilot(self) -> np.ndarray:
        """Return the first starts that walk."""
        return self.next_starts(np.full(STRATA, PILOT))
