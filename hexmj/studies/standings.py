"""Standings of the league: frequencies with their intervals, differences and ranks, as a dataset and as tables."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hexmj.controllers.protocol import Controller
from hexmj.io import markdown_table, settings
from hexmj.measures.figures import network_rules, starts_in_words
from hexmj.measures.tables import VELOCITY, differences, frequencies, happened, over_cells
from hexmj.phases import circular_mean
from hexmj.stats import paired_difference

if TYPE_CHECKING:
    import xarray as xr

LEGS_LOST = {f"lost {leg + 1}": leg for leg in (0, 1, 2)}
"""Trial in which a leg is lost -> index of the leg: front, middle or hind."""

READING: tuple[str, ...] = ("reads", "noise", "late")
"""Trials with sensory feedback: exact, noisy, delayed."""

TRIALS = ("halt", "leg", "push", "step", "rough", "load", *LEGS_LOST, *READING)
"""Names of all trials of the league."""

ABOUT_TRIALS = (
    "halt, leg, push: a halt, a swinging leg that is stopped, a push of 40 m V_p, in walks with stable plans until"
    " then; step, rough: ground of 0.3 of the body's standing height; load: twice the weight; lost: without one leg;"
    " reads: sensory feedback; noise: with errors of 10 % of the step range; late: delayed by 20 ms; -: the plan cannot"
    " be steered or has no feedback, the walk is too short, or no walk is left"
)
"""Explanation of the trials, printed above their table."""

OVER_VELOCITY = ("entrant", "velocity")

UNITS = {"slip": "mm/s", "reached": "time unit"}
"""Variable of the standings -> its unit; the other variables are plain numbers."""

OPTIONAL = ("lost", "fell", "reached", "stable", "duty_factor", "ipsilateral", "contralateral")
"""Variables of cells that some entrants do not have; they become NaN."""

REFERENCE = "ldvs"
"""Entrant to which all others are compared; if it does not take part, the first entrant is used."""


def standings(
    entrants: Mapping[str, Controller], velocities: np.ndarray, data: Mapping[tuple[str, str], "xr.Dataset"]
) -> "xr.Dataset":
    """Return the results of all cells of the league as one dataset.

    Args:
        entrants: controllers by name.
        velocities: velocities V_r, (velocity,).
        data: result of every cell by entrant and question.

    Returns:
        Over (entrant, velocity): the FLSS of `MEASURES` with `_low`, `_high` (95 % Wilson); with `_above`, the FLSS
        minus that of the `reference` on the same starts, and its 95 % interval. For walks without a fall: actual over
        commanded `speed`, `slip` [mm/s], `cost` of transport, highest `torque` of a joint over its limit. The number
        of walks that failed, `missing`. For steady-state gaits: the fractions of starts that are `periodic` and
        `stable`, the median time until it is `reached` [time units], `duty_factor` and the phases `ipsilateral` and
        `contralateral`.
        Over (entrant, measure): `best` and `worst` rank by the mean over velocities. Over (entrant, trial): `fell`,
        and kinematic `lost`, with intervals.
        The number of starts behind a frequency has the suffix `_starts`.
    """
    import xarray as xr

    names, nothing = list(entrants), xr.Dataset(dict.fromkeys(OPTIONAL, ("start", [])))

    def cells(questions: Iterable[str], axis: str = "velocity") -> "xr.Dataset":
        """Return the results of cells over (entrant, question, start); the second axis is named `axis`."""
        listed = list(questions)
        found = [data.get((name, question), nothing) for name in names for question in listed]
        return over_cells({"entrant": len(names), axis: len(listed)}, found)

    planned, walked, gaits = (
        cells(f"{kind} {v}" for v in velocities.tolist()) for kind in ("kinematic", "physics", "gait")
    )
    events = {"kinematic": planned.lost}
    events |= {measure: happened(walked[f"{measure}_loss"]) for measure in ("dynamic", "grounded", "carried")}
    events["physical"] = walked.fell
    reference = REFERENCE if REFERENCE in names else names[0]
    table: dict[str, Any] = {}
    places = []
    for measure in MEASURES:
        values = events[measure].values
        table |= frequencies(measure, values, OVER_VELOCITY)
        table |= differences(f"{measure}_above", values, values[names.index(reference)], OVER_VELOCITY)
        places.append(ranks(values.mean(axis=1)))
    best, worst = np.transpose(places, (1, 2, 0))
    table |= {"best": (("entrant", "measure"), best), "worst": (("entrant", "measure"), worst)}
    over_trials = "entrant", "trial"
    table |= frequencies("fell", cells(TRIALS, "trial").fell.values, over_trials)
    table |= frequencies("lost", cells([f"kinematic, {trial}" for trial in TRIALS], "trial").lost.values, over_trials)
    upright = walked.where(np.isinf(walked.fall))
    table |= {
        "speed": upright.speed.mean("start"),
        "slip": upright.slip.mean("start"),
        "cost": upright.work.sum("start") / upright.way.sum("start"),
        "torque": upright.torque.max("start"),
        "missing": walked.missing.sum("start"),
        "periodic": happened(gaits.reached).mean("start"),
        "stable": gaits.stable.mean("start"),
        "reached": gaits.reached.median("start"),
        "duty_factor": gaits.duty_factor.mean("start"),
    }
    for phase in ("ipsilateral", "contralateral"):
        table[phase] = OVER_VELOCITY, np.apply_along_axis(_phase, 2, gaits[phase].values)
    velocity = ("velocity", velocities, VELOCITY)
    axes = {"entrant": names, "velocity": velocity, "trial": list(TRIALS), "measure": list(MEASURES)}
    result = xr.Dataset(table, axes, {"reference": reference})
    for name, values in result.items():
        values.attrs = {"units": UNITS.get(str(name), "1")}
    return result


def ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the best and the worst possible rank of each entrant, both (entrant,); rank 1 is the best.

    Args:
        values: scores on the same starts, (entrant, start), lower is better; an entrant with NaN only gets rank 0.

    Returns:
        Best rank: 1 + number of significantly better entrants. Worst: number of ranked minus significantly worse ones.
    """
    ranked = np.isfinite(values).any(axis=1)
    best, worst = np.zeros(len(values), dtype=int), np.zeros(len(values), dtype=int)
    for i in np.flatnonzero(ranked):
        _, low, high = paired_difference(values[i], values[ranked])  # its own interval contains 0
        best[i], worst[i] = 1 + (low > 0).sum(), ranked.sum() - (high < 0).sum()
    return best, worst


def _phase(values: np.ndarray) -> float:
    """Return the circular mean of the finite phases among values, (start,); NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(circular_mean(known)) if len(known) else np.nan


LESS, MORE = "-", "+"
"""Marks of a frequency that is significantly below or above that of the reference."""

WEDGED = 5.0
"""Peak torque of a cockroach that wedges into a crevice, about the coxa-femur joint of a hind leg, over body weight
times leg length: muscle forces above 50 body weights act at a tenth of the leg's length (Full & Ahn 1995, J. exp. Biol.
198, 1285, abstract). No value for a stick insect was found."""

MEASURES = {
    "kinematic": "Kinematic FLSS",
    "dynamic": "FLDS",
    "grounded": "Grounded FLSS",
    "carried": "Carried FLSS",
    "physical": "Frequency of falls",
}


class Table(NamedTuple):
    """A table of texts with its title and column headings."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


def tables(result: "xr.Dataset") -> list[Table]:
    """Return all tables of a league's standings, entrants from best to worst."""
    shown = by_rank(result)
    over_velocity = [_over_velocity(shown, measure, title) for measure, title in MEASURES.items()]
    at = shown.sel(velocity=shown.attrs["trial_velocity"], method="nearest")
    return [_ranks(shown), *over_velocity, _gaits(at), _trials(shown), _costs(at)]


def league_markdown(result: "xr.Dataset") -> str:
    """Return all tables of a league's standings as Markdown."""
    parts = [f"### {table.title}\n\n" + "\n".join(markdown_table(table.head, table.rows)) for table in tables(result)]
    return "\n\n".join(parts) + "\n"


def by_rank(result: "xr.Dataset") -> "xr.Dataset":
    """Sort entrants by mean physical FLSS, then by mean kinematic FLSS; entrants without any come last."""
    falls, losses = (result[measure].mean("velocity").values for measure in ("physical", "kinematic"))
    return result.isel(entrant=np.lexsort((losses, falls))).transpose("entrant", ...)


def frequency(cell: "xr.Dataset", name: str) -> str:
    """Return the text of a scalar frequency with its interval, such as ".52 (.39-.64)"; "-" if it is NaN."""
    middle, low, high = (_short(cell[name + end].item()) for end in ("", "_low", "_high"))
    return "-" if middle == "nan" else f"{middle} ({low}-{high})"


def _rows(shown: "xr.Dataset", row: Callable[["xr.Dataset"], Iterable[str]]) -> list[tuple[str, ...]]:
    """Return a row of texts for each entrant: its name, and the texts that the function `row` returns for its data."""
    return [(name, *row(shown.sel(entrant=name))) for name in shown.entrant.values]


def _ranks(shown: "xr.Dataset") -> Table:
    controllers = settings(shown)["controllers"]

    def row(entrant: "xr.Dataset") -> Iterable[str]:
        means = (_known(f"{entrant[measure].mean(skipna=False).item():.3f}") for measure in MEASURES)
        return (mean + place(entrant.sel(measure=measure)) for measure, mean in zip(MEASURES, means, strict=True))

    rows = []
    for (name, *cells), missing in zip(_rows(shown, row), shown.missing.sum("velocity"), strict=True):
        rules = f" ({words})" if (words := network_rules(controllers[name])) else ""
        lost = f" (walks missing: {missing.item():g})" if missing else ""
        rows.append((name + rules + lost, *cells))
    title = "Standings: means over the velocities, and ranks where intervals separate them; = is a tie"
    return Table(title, ("controller", *MEASURES), rows)


def place(cell: "xr.Dataset") -> str:
    """Return the text of a rank in brackets, such as ' (2)', or ' (=3-6)' for a tie; empty without a rank."""
    best, worst = cell.best.item(), cell.worst.item()
    return "" if best == 0 else f" ({best})" if best == worst else f" (={best}-{worst})"


def _over_velocity(shown: "xr.Dataset", measure: str, title: str) -> Table:
    def text(cell: "xr.Dataset") -> str:
        fewer = measure != "kinematic" and cell.missing.item()
        below, above = cell[f"{measure}_above_high"].item() < 0, cell[f"{measure}_above_low"].item() > 0
        left = f" of {cell[f'{measure}_starts'].item()}" if fewer else ""
        return frequency(cell, measure) + left + (f" {LESS}" if below else f" {MORE}" if above else "")

    rows = _rows(shown, lambda entrant: [text(entrant.isel(velocity=i)) for i in range(shown.sizes["velocity"])])
    reference, starts = shown.attrs["reference"], shown[f"{measure}_starts"].max().item()
    title += f" of {starts_in_words(starts)}; {LESS} below {reference} on the same starts, {MORE} above"
    return Table(title, ("controller", *(f"V = {v:g}" for v in shown.velocity.values)), rows)


def _gaits(at: "xr.Dataset") -> Table:
    def row(entrant: "xr.Dataset") -> Iterable[str]:
        shares = (f"{entrant[key].item():.2f}" for key in ("periodic", "stable"))
        phases = (f"{entrant[key].round(2).item() % 1.0:.2f}" for key in ("ipsilateral", "contralateral"))
        return map(_known, (*shares, f"{entrant.reached.item():.0f}", *phases, f"{entrant.duty_factor.item():.2f}"))

    head = ("controller", "periodic", "statically stable", "reached after", "ipsilateral", "contralateral", "duty")
    title = f"Steady-state gaits at V = {at.velocity.item():g}: shares, median time, phases, duty factor"
    return Table(title, head, _rows(at, row))


def _trials(shown: "xr.Dataset") -> Table:
    most = shown.fell_starts.max().item()

    def row(entrant: "xr.Dataset") -> Iterable[str]:
        for share, starts in zip(entrant.fell.values, entrant.fell_starts.values, strict=True):
            yield _known(f"{share:.2f}") + (f" of {starts}" if 0 < starts < most else "")
        yield _known(f"{entrant.lost.sel(trial=list(LEGS_LOST)).mean().item():.2f}")

    v = shown.attrs["trial_velocity"]
    title = f"Falls at V = {v:g} in {starts_in_words(most)}; kinematic: losses, mean of three lost legs. {ABOUT_TRIALS}"
    return Table(title, ("controller", *shown.trial.values, "kinematic"), _rows(shown, row))


def _costs(at: "xr.Dataset") -> Table:
    def row(entrant: "xr.Dataset") -> Iterable[str]:
        costs = (f"{entrant[key].item():.3g}" for key in ("speed", "slip", "cost", "torque"))
        return map(_known, (*costs, f"{entrant.torque.item() / WEDGED:.2f}"))

    head = ("controller", "speed kept", "slip [mm/s]", "cost of transport", "peak torque", "of a cockroach's")
    return Table(f"Walks without a fall at V = {at.velocity.item():g}", head, _rows(at, row))


def _short(value: float) -> str:
    """Return a number with two digits after the point, or up to three below 0.1, and without a leading zero."""
    text = f"{value:.2f}" if value >= 0.1 else f"{value:.3f}".rstrip("0").rstrip(".")
    return text.replace("0.", ".", 1)


def _known(text: str) -> str:
    """Return the text of a number unchanged, except "-" for "nan" and "never" for "inf"."""
    return {"nan": "-", "inf": "never"}.get(text, text)
