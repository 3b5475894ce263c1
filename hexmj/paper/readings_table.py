"""The comparison of readings as a page: Markdown."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hexmj.controllers.cruse1998 import READINGS
from hexmj.paper.protocol import Protocol
from hexmj.paper.readings import CALIBRATED, CHOICES, agreeing, effects, gained, ranking, title
from hexmj.paper.table import line
from hexmj.timing import WINDOWS

if TYPE_CHECKING:
    import xarray as xr

HEADS = ("reading", *(f"held out, {window}" for window in WINDOWS), "calibrated", "missed by", "refined constants")


def readings_rows(scores: "xr.Dataset", places: Sequence[int]) -> list[tuple[str, ...]]:
    """Cells of readings, as under `HEADS`: claims that agree with constants as inferred / refined."""
    held, calibrated = agreeing(scores), agreeing(scores, held_out=False)
    rows = []
    for i in places:
        one = scores.isel(reading=i)
        cells = [_both(held.isel(reading=i).sel(window=window)) for window in WINDOWS]
        of = _both(calibrated.isel(reading=i).max("window"))
        miss = " / ".join(f"{miss:.2f}" for miss in one.miss.sum("claim").min("window").values)
        rows.append((one.reading.item(), *cells, of, miss, _constants(one)))
    return rows


def readings_markdown(scores: "xr.Dataset", readings: Sequence[Protocol]) -> str:
    """The page: best readings, what each choice alone changes, a closer look, and every reading."""
    held = [key for key in scores.claim.values if key not in CALIBRATED]
    size = readings[0]
    lines = [
        "# Readings of the 1998 paper",
        "",
        f"{len(held)} held-out and {scores.sizes['claim'] - len(held)} calibrated claims on the printed sets; each"
        f" is judged on {size.samples * size.sample} starts and {size.gait_starts} gaits, seed {size.seed}.  Before the"
        " slash: constants as inferred, by which readings are ranked; behind it: refined, on calibrated claims alone."
        "  'Calibrated' and 'missed by', how far answers lie outside of their rules in sum, are of the better window.",
        "",
        *_table(HEADS, readings_rows(scores, ranking(scores).tolist()[: scores.sizes["best"]])),
        "",
        "## As printed, and the named readings",
        "",
        *_table(HEADS, readings_rows(scores, _named(readings))),
        "",
    ]
    for name in [title(readings[i]) for i in _named(readings)][1:]:
        for window in WINDOWS:
            more, less = gained(scores, name, window)
            lines.append(
                f"- {name}, window {window}: gains {', '.join(more) or 'none'}; loses {', '.join(less) or 'none'}"
            )
    changed = effects(scores, readings)
    rows = [
        (choice, *(f"{changed.sel(choice=choice, window=window).item():.1f}" for window in WINDOWS))
        for choice in changed.choice.values
    ]
    lines += [
        "",
        "## What a choice alone changes: held-out claims that agree, mean over all others, constants as inferred",
        "",
    ]
    lines += [*_table(("choice", *WINDOWS), rows), "", "## A closer look at the best", ""]
    looked = (scores.aside_agrees == 1).sel(claim=held).sum("claim").max("window")
    without = agreeing(scores).sel(constants="refined").max("window")
    rows = [
        (name, str(without.sel(reading=name).item()), *map(str, looked.sel(best=name).values.tolist()))
        for name in scores.best.values
    ]
    lines += [
        "Held-out claims that agree with the choices of which only acceleration or the measure knows: refined"
        " constants, in the better window.",
        "",
        *_table(("reading", "none of them", *scores.aside.values), rows),
        "",
    ]
    judged = (scores.ideal_agrees == 1).any("window")
    rows = [
        (
            name,
            f"{judged.sel(best=name).sum().item()} of {judged.sizes['ideal_claim']}",
            *(f"{one:.4f}" for one in scores.ideal_flss.sel(best=name).values),
        )
        for name in scores.best.values
    ]
    heads = ("reading", "claims on ideal sets", *(f"V = {v:g}" for v in scores.ideal_velocity.values))
    lines += [
        "FLSS of ideal sets that a short search found under each, window walk, refined constants.",
        "",
        *_table(heads, rows),
        "",
    ]
    lines += ["## Every reading", "", *_table(HEADS, readings_rows(scores, ranking(scores).tolist()))]
    return "\n".join(lines) + "\n"


def _named(readings: Sequence[Protocol]) -> list[int]:
    """Places of the readings that have a name, in the order of `READINGS`."""
    places = [i for i, one in enumerate(readings) if one.order == CHOICES["order"][0]]
    return [i for reading in READINGS.values() for i in places if readings[i].reading == reading]


def _both(counts: "xr.DataArray") -> str:
    return " / ".join(str(counts.sel(constants=one).item()) for one in ("inferred", "refined"))


def _constants(one: "xr.Dataset") -> str:
    geometry = "centred" if one.centred.item() else "fig1"
    lengths = (one[name].item() for name in ("aep0", "pep0", "pep_min"))
    return ", ".join([*(f"{length:g}" for length in lengths), geometry])


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [line(heads), line(["---"] * len(heads)), *(line(row) for row in rows)]
