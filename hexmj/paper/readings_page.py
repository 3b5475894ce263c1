"""The comparison of readings as a page: Markdown."""

import math
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

from hexmj.controllers.cruse1998 import MODEL_VARIANTS
from hexmj.io import markdown_table
from hexmj.paper.protocol import Protocol
from hexmj.paper.readings import CALIBRATED, CHOICES, agreeing, effects, gained, ranking, title
from hexmj.timing import OBSERVATION_TIMES

if TYPE_CHECKING:
    import xarray as xr

HEADS = (
    "model_variant",
    *(f"held out, {observation_time}" for observation_time in OBSERVATION_TIMES),
    "calibrated",
    "missed by",
    "refined constants",
)


def readings_rows(scores: "xr.Dataset", places: Sequence[int]) -> list[tuple[str, ...]]:
    """Cells of readings, as under `HEADS`: claims that agree with constants as inferred / refined."""
    held, calibrated = agreeing(scores), agreeing(scores, held_out=False)
    rows = []
    for i in places:
        one = scores.isel(model_variant=i)
        cells = [
            _both(held.isel(model_variant=i).sel(observation_time=observation_time))
            for observation_time in OBSERVATION_TIMES
        ]
        of = _both(calibrated.isel(model_variant=i).max("observation_time"))
        miss = " / ".join(f"{miss:.2f}" for miss in one.miss.sum("claim").min("observation_time").values)
        rows.append((one.model_variant.item(), *cells, of, miss, _constants(one)))
    return rows


def readings_markdown(scores: "xr.Dataset", model_variants: Sequence[Protocol]) -> str:
    """The page: best readings, what each choice alone changes, if all are combined, a closer look, every reading."""
    ranked = ranking(scores).tolist()
    change = "## What a choice alone changes: held-out claims that agree, mean over all others, constants as inferred"
    all_combined = len(model_variants) == math.prod(map(len, CHOICES.values()))
    sections = {
        "# Readings of the 1998 paper": [
            _judged_on(scores, model_variants[0]),
            *markdown_table(HEADS, readings_rows(scores, ranked[: scores.sizes["best"]])),
        ],
        "## As printed, and the named readings": _named_ones(scores, model_variants),
        **({change: _changes(scores, model_variants)} if all_combined else {}),
        "## A closer look at the best": [*_aside(scores), "", *_ideal_sets(scores)],
        "## Every reading": markdown_table(HEADS, readings_rows(scores, ranked)),
    }  # fmt: skip
    return "\n\n".join(f"{head}\n\n" + "\n".join(lines) for head, lines in sections.items()) + "\n"


def _judged_on(scores: "xr.Dataset", one: Protocol) -> str:
    held = len(_held_out(scores))
    return (
        f"{held} held-out and {scores.sizes['claim'] - held} calibrated claims on the printed sets; each"
        f" is judged on {one.samples * one.sample} starts and {one.gait_starts} gaits, seed {one.seed}.  Before the"
        " slash: constants as inferred, by which readings are ranked; behind it: refined, on calibrated claims alone."
        "  'Calibrated' and 'missed by', how far answers lie outside of their rules in sum, are of the better observation time.\n"
    )


def _named_ones(scores: "xr.Dataset", model_variants: Sequence[Protocol]) -> list[str]:
    """All that have a name, and what each gains and loses against the printed one."""
    places = _named(model_variants)
    lines = [*markdown_table(HEADS, readings_rows(scores, places)), ""]
    for name, observation_time in product([title(model_variants[i]) for i in places[1:]], OBSERVATION_TIMES):
        more, less = (", ".join(keys) or "none" for keys in gained(scores, name, observation_time))
        lines.append(f"- {name}, observation time {observation_time}: gains {more}; loses {less}")
    return lines


def _changes(scores: "xr.Dataset", model_variants: Sequence[Protocol]) -> list[str]:
    changed = effects(scores, model_variants)
    rows = [
        (
            choice,
            *(
                f"{changed.sel(choice=choice, observation_time=observation_time).item():.1f}"
                for observation_time in OBSERVATION_TIMES
            ),
        )
        for choice in changed.choice.values
    ]
    return markdown_table(("choice", *OBSERVATION_TIMES), rows)


def _aside(scores: "xr.Dataset") -> list[str]:
    """The best with each of the choices of which only acceleration or the measure knows."""
    looked = (scores.aside_agrees == 1).sel(claim=_held_out(scores)).sum("claim").max("observation_time")
    without = agreeing(scores).sel(constants="refined").max("observation_time")
    rows = [
        (name, str(without.sel(model_variant=name).item()), *map(str, looked.sel(best=name).values.tolist()))
        for name in scores.best.values
    ]
    told = (
        "Held-out claims that agree with the choices of which only acceleration or the measure knows: refined"
        " constants, in the better observation time."
    )
    return [told, "", *markdown_table(("model_variant", "none of them", *scores.aside.values), rows)]


def _ideal_sets(scores: "xr.Dataset") -> list[str]:
    """What a search found under each of the best."""
    judged = (scores.ideal_agrees == 1).any("observation_time")
    rows = [
        (
            name,
            f"{judged.sel(best=name).sum().item()} of {judged.sizes['ideal_claim']}",
            *(f"{one:.4f}" for one in scores.ideal_flss.sel(best=name).values),
        )
        for name in scores.best.values
    ]
    heads = ("model_variant", "claims on ideal sets", *(f"V = {v:g}" for v in scores.ideal_velocity.values))
    told = "FLSS of ideal sets that a short search found under each, observation time walk, refined constants."
    return [told, "", *markdown_table(heads, rows)]


def _held_out(scores: "xr.Dataset") -> list[str]:
    return [key for key in scores.claim.values if key not in CALIBRATED]


def _named(model_variants: Sequence[Protocol]) -> list[int]:
    """Places of the readings that have a name, in the order of `MODEL_VARIANTS`."""
    places = [i for i, one in enumerate(model_variants) if one.order == CHOICES["order"][0]]
    return [
        i
        for model_variant in MODEL_VARIANTS.values()
        for i in places
        if model_variants[i].model_variant == model_variant
    ]


def _both(counts: "xr.DataArray") -> str:
    return " / ".join(str(counts.sel(constants=one).item()) for one in ("inferred", "refined"))


def _constants(one: "xr.Dataset") -> str:
    geometry = "centred" if one.centred.item() else "fig1"
    lengths = (one[name].item() for name in ("aep0", "pep0", "pep_min"))
    return ", ".join([*(f"{length:g}" for length in lengths), geometry])
