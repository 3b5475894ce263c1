"""The league as tables: each a title, a head and rows of texts, for the terminal and as Markdown."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hexmj.io import markdown_table, settings
from hexmj.measures.captions import rules, starts_in_words
from hexmj.measures.drawable_parts import check_axes, check_whole, what_parts_may_lack
from hexmj.studies.league.trials import LEGS_LOST, TOLD

if TYPE_CHECKING:
    import xarray as xr

LESS, MORE = "-", "+"
"""Beside a frequency that is below, or above, that of the reference for sure."""

WEDGED = 5.0
"""What a cockroach's hind leg reaches about its coxa-femur joint as it wedges itself into a crevice, over weight times
length of the leg: its muscles pull with over 50 times the weight at a tenth of the leg's arm (Full & Ahn 1995, J. exp.
Biol. 198, 1285, abstract).  Of a stick insect nothing was found."""

MEASURES = {"kinematic": "Kinematic FLSS", "measured": "Measured FLSS", "physical": "Physical FLSS"}


@dataclass(frozen=True)
class Table:
    """One table."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


def tables(result: "xr.Dataset") -> list[Table]:
    """Everything that is told of a result of `League`.

    Raises:
        InputError: a part of it that holds too little.
    """
    check_axes(result)
    with what_parts_may_lack(result, "the tables of a league cannot be made"):
        shown = by_rank(result)
        over_velocity = [_over_velocity(shown, measure, title) for measure, title in MEASURES.items()]
        at = shown.isel(velocity=int(np.abs(shown.velocity.values - shown.attrs["tried_at"]).argmin()))  # or nearest
        return [_ranks(shown), *over_velocity, _regimes(at), _trials(shown), _costs(at)]


def league_markdown(result: "xr.Dataset") -> str:
    """All tables as Markdown."""
    parts = [f"### {one.title}\n\n" + "\n".join(markdown_table(one.head, one.rows)) for one in tables(result)]
    return "\n\n".join(parts) + "\n"


def by_rank(result: "xr.Dataset") -> "xr.Dataset":
    """The entrants from best to worst in physics, then on paper; those from ideal starts last.

    Raises:
        InputError: a part of the velocities, over which the ranks are.
    """
    check_whole(result, "velocity", len(settings(result)["velocities"]))
    falls, losses = (result[measure].mean("velocity").values for measure in ("physical", "kinematic"))
    unranked = result.best.sel(measure="physical").values == 0
    return result.isel(entrant=np.lexsort((losses, falls, unranked))).transpose("entrant", ...)


def from_one(result: "xr.Dataset") -> str:
    """In words, who of a result of `League` walks from one start, the ideal one, where others walk from more; nothing
    where nobody does."""
    alone = (result.kinematic_starts == 1).all("velocity").values
    return f"{', '.join(result.entrant.values[alone])} from one start" if alone.any() and not alone.all() else ""


def frequency(one: "xr.Dataset", name: str) -> str:
    """A frequency with its interval; "-" where it is not known."""
    middle, low, high = (one[name + end].item() for end in ("", "_low", "_high"))
    return "-" if np.isnan(middle) else f"{_short(middle)} ({_short(low)}-{_short(high)})"


def _entrants(shown: "xr.Dataset") -> "list[tuple[str, xr.Dataset]]":
    return [(name, shown.sel(entrant=name)) for name in shown.entrant.values]


def _ranks(shown: "xr.Dataset") -> Table:
    rows, controllers = [], settings(shown)["controllers"]
    for name, one in _entrants(shown):
        told = f" ({words})" if (words := rules(controllers[name])) else ""
        told += f" (walks missing: {one.missing.sum().item():g})" if one.missing.any() else ""
        places = [_mean(one[measure]) + place(one.sel(measure=measure)) for measure in MEASURES]
        rows.append((name + told, *places, frequency(one, "range"), frequency(one, "accelerated")))
    title = "Standings: means over the velocities, and ranks where intervals separate them; = is a tie"
    return Table(title, ("controller", *MEASURES, "J_N, 0.1 to 0.5", "accelerated to 0.9"), rows)


def _mean(over_velocities: "xr.DataArray") -> str:
    """Of frequencies at all velocities; "-" where one is not known."""
    return _known(f"{over_velocities.mean(skipna=False).item():.3f}")


def _left(one: "xr.Dataset", measure: str) -> str:
    """Of how many walks, where some are missing."""
    return f" of {one[f'{measure}_starts'].item()}" if measure != "kinematic" and one.missing.item() else ""


def place(one: "xr.Dataset") -> str:
    """Rank in brackets: '(2)', '(=3-6)', nothing where there is none."""
    best, worst = one.best.item(), one.worst.item()
    return "" if best == 0 else f" ({best})" if best == worst else f" (={best}-{worst})"


def _over_velocity(shown: "xr.Dataset", measure: str, title: str) -> Table:
    rows = []
    for name, one in _entrants(shown):
        cells = (one.isel(velocity=i) for i in range(shown.sizes["velocity"]))
        rows.append((name, *(frequency(one, measure) + _left(one, measure) + _against(one, measure) for one in cells)))
    reference, starts = shown.attrs["reference"], shown[f"{measure}_starts"].max().item()
    told = f"{title} of {starts_in_words(starts)}"
    told += f"; {LESS} below {reference} on the same starts, {MORE} above" if reference else ""
    told += f"; {alone}" if (alone := from_one(shown)) else ""
    return Table(told, ("controller", *(f"V = {v:g}" for v in shown.velocity.values)), rows)


def _against(one: "xr.Dataset", measure: str) -> str:
    low, high = one[f"{measure}_above_low"].item(), one[f"{measure}_above_high"].item()
    return f" {LESS}" if high < 0 else f" {MORE}" if low > 0 else ""


def _regimes(at: "xr.Dataset") -> Table:
    rows = []
    for name, one in _entrants(at):
        shares = (f"{one[key].item():.2f}" for key in ("periodic", "stable"))
        phases = (f"{one[key].round(2).item() % 1.0:.2f}" for key in ("ipsilateral", "contralateral"))
        regime = *shares, f"{one.reached.item():.0f}", *phases, f"{one.duty_factor.item():.2f}"
        rows.append((name, *map(_known, regime)))
    head = ("controller", "periodic", "statically stable", "reached after", "ipsilateral", "contralateral", "duty")
    return Table(f"Limit regimes at V = {at.velocity.item():g}: shares, median time, phases, duty factor", head, rows)


def _trials(shown: "xr.Dataset") -> Table:
    rows, most = [], shown.fell_starts.max().item()
    for name, one in _entrants(shown):
        falls = (_share(*pair, most) for pair in zip(one.fell.values, one.fell_starts.values, strict=True))
        rows.append((name, *falls, _known(f"{one.lost.sel(trial=list(LEGS_LOST)).mean().item():.2f}")))
    v = shown.attrs["tried_at"]
    title = f"Falls at V = {v:g} in {starts_in_words(most)}; at last losses on paper, mean of three lost legs.  {TOLD}"
    return Table(title, ("controller", *shown.trial.values, "paper"), rows)


def _costs(at: "xr.Dataset") -> Table:
    rows = []
    for name, one in _entrants(at):
        cells = [f"{one[key].item():.3g}" for key in ("speed", "slip", "cost", "torque")]
        cells.append(f"{one.torque.item() / WEDGED:.2f}")
        missing = f" (walks missing: {one.missing.item():g})" if one.missing else ""
        rows.append((name + missing, *map(_known, cells)))
    head = ("controller", "speed kept", "slip [mm/s]", "cost of transport", "peak torque", "of a cockroach's")
    return Table(f"Walks without a fall at V = {at.velocity.item():g}", head, rows)


def _short(value: float) -> str:
    """Two digits after the point, three where they matter, without a leading zero."""
    text = f"{value:.2f}" if value >= 0.1 else f"{value:.3f}".rstrip("0").rstrip(".")
    return text.replace("0.", ".", 1)


def _share(value: float, starts: int, most: int) -> str:
    """A share, and of how many starts where it is not of all."""
    return _known(f"{value:.2f}") + (f" of {starts}" if 0 < starts < most else "")


def _known(text: str) -> str:
    """The text of a number, "-" for none."""
    return {"nan": "-", "inf": "never"}.get(text, text)
