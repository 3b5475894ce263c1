"""What the league's cells come to: frequencies with their intervals, differences to one entrant, ranks."""

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.velocities import VELOCITY
from hexmj.phases import circular_mean
from hexmj.stats import paired_difference
from hexmj.studies.frequencies import came, differences, frequencies, padded
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.league.trials import TRIALS

if TYPE_CHECKING:
    import xarray as xr

Data = Mapping[tuple[str, str], "xr.Dataset"]
"""Of every cell, by its entrant and what it was asked."""

Rows = Sequence[Sequence["xr.Dataset | None"]]
"""Cells by (row, column); None where there is none."""

OVER_VELOCITY = ("entrant", "velocity")

UNITS = {"slip": "mm/s", "reached": "time unit"}
"""Of what is no frequency, rank, phase or ratio."""

REFERENCE = "ldvs"
"""Whom all are compared with; where it does not take part the first entrant from random starts, if there is one."""


def standings(entrants: Mapping[str, Entrant], velocities: np.ndarray, data: Data) -> "xr.Dataset":
    """A league of entrants by name, at velocities V_r, (velocity,), as one dataset.

    Returns:
        Over (entrant, velocity): `kinematic`, `measured` and `physical` FLSS with `_low`, `_high` (95 % Wilson), and
        how far they are above those of the `reference` on the same starts, `_above`, with its interval; of walks
        without a fall the `speed` over that commanded, `slip` [mm/s], `cost` of transport, and the greatest `torque`
        of a joint over its limit; how many walks are `missing`, since they were refused; of limit regimes the share
        that is `periodic` and `stable`, the median `reached` [time units], `duty_factor` and the phases `ipsilateral`
        and `contralateral`.
        Over entrant: `range`, J_N, and `accelerated`, with intervals; over (entrant, measure) the `best` and `worst`
        rank, by the mean over velocities.  Over (entrant, trial): `fell`, and on paper `lost`, with intervals.
        All frequencies have the number of their `_starts`.
    """
    import xarray as xr

    names, v = list(entrants), velocities.tolist()
    on_paper, walked, regimes = (
        [[data.get((name, f"{kind} {one}")) for one in v] for name in names] for kind in ("paper", "physics", "regime")
    )
    happened = {
        "kinematic": _each(on_paper, LOST),
        "measured": _each(walked, lambda one: came(one.measured_loss)),
        "physical": _each(walked, lambda one: came(one.fall)),
    }
    random = [name for name, entrant in entrants.items() if not entrant.ideal]
    reference = REFERENCE if REFERENCE in random else next(iter(random), "")
    ideal = np.array([entrant.ideal for entrant in entrants.values()])[:, None, None]
    same = {measure: np.where(ideal, np.nan, values) for measure, values in happened.items()}  # the same random starts
    table: dict[str, Any] = {}
    for measure, values in same.items():
        table |= frequencies(measure, happened[measure], OVER_VELOCITY)
        table |= differences(f"{measure}_above", values, values[names.index(reference or names[0])], OVER_VELOCITY)
    for asked in ("range", "accelerated"):
        table |= frequencies(asked, _each([[data.get((name, asked)) for name in names]], LOST)[0], OVER_VELOCITY[:1])
    over_trials = "entrant", "trial"
    tried, lamed = ([[data.get((name, kind + one)) for one in TRIALS] for name in names] for kind in ("", "paper, "))
    table |= frequencies("fell", _each(tried, _fell), over_trials)
    table |= frequencies("lost", _each(lamed, LOST), over_trials)
    best, worst = np.array([ranks(values.mean(axis=1)) for values in same.values()]).transpose(1, 2, 0)
    table |= {"best": (("entrant", "measure"), best), "worst": (("entrant", "measure"), worst)}
    table |= {name: _over(walked, find) for name, find in OF_WALKS.items()}
    table["missing"] = _over(walked, lambda one: one.fall.isnull().sum())
    table |= {name: _over(regimes, find) for name, find in OF_REGIMES.items()}
    velocity = ("velocity", velocities, VELOCITY)
    axes = {"entrant": names, "velocity": velocity, "trial": list(TRIALS), "measure": list(happened)}
    result = xr.Dataset(table, axes, {"reference": reference})
    for name, values in result.items():
        values.attrs["units"] = UNITS.get(str(name), "1")
    return result


def ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best and worst rank that each may have, (entrant,), from 1 on; equal only where intervals separate it from all.

    Args:
        values: of the same starts, (entrant, start), less is better; an entrant that is NaN throughout has no rank,
            which is 0.

    Returns:
        1 and how many are better for sure; the number of those that are ranked less how many are worse for sure.
    """
    ranked = np.isfinite(values).any(axis=1)
    best, worst = np.zeros(len(values), dtype=int), np.zeros(len(values), dtype=int)
    for i in np.flatnonzero(ranked):
        _, low, high = paired_difference(values[i], values[ranked])  # of itself the interval holds 0
        best[i], worst[i] = 1 + (low > 0).sum(), ranked.sum() - (high < 0).sum()
    return best, worst


LOST = attrgetter("lost")


def _fell(one: "xr.Dataset") -> "xr.DataArray":
    """Of a disturbance, or of walks from the start on."""
    return one.fell if "fell" in one else came(one.fall)


def _upright(one: "xr.Dataset") -> "xr.Dataset":
    """The walks without a fall."""
    return one.isel(start=np.isinf(one.fall.values))


OF_WALKS = {
    "speed": lambda one: _upright(one).speed.mean(),
    "slip": lambda one: _upright(one).slip.mean(),
    "cost": lambda one: _upright(one).work.sum() / _upright(one).way.sum(),
    "torque": lambda one: _upright(one).torque.max() if _upright(one).start.size else np.nan,
}
"""What is told of walks at one velocity, of those without a fall; NaN where all fell."""

OF_REGIMES = {
    "periodic": lambda one: np.isfinite(one.reached).mean(),
    "stable": lambda one: one.stable.mean(),
    "reached": lambda one: one.reached.median(),
    "duty_factor": lambda one: one.duty_factor.mean(),
    "ipsilateral": lambda one: _phase(one.ipsilateral),
    "contralateral": lambda one: _phase(one.contralateral),
}
"""What is told of limit regimes at one velocity; duty factor and phases are NaN where none was reached."""


def _phase(values: "xr.DataArray") -> float:
    """Circular mean of those that are known."""
    known = values.values[np.isfinite(values.values)]
    return float(circular_mean(known)) if len(known) else np.nan


def _over(rows: Rows, find: Callable[["xr.Dataset"], Any]) -> tuple[tuple[str, ...], np.ndarray]:
    """One number of each cell, (entrant, velocity); NaN where there is none."""
    return OVER_VELOCITY, np.array([[np.nan if one is None else float(find(one)) for one in row] for row in rows])


def _each(rows: Rows, find: Callable[["xr.Dataset"], "xr.DataArray"]) -> np.ndarray:
    """What happened to each start of each cell, (row, column, start); NaN where there is no cell."""
    return padded([[[] if one is None else find(one) for one in row] for row in rows])
