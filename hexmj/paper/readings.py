"""Which reading of the paper explains its numbers best: every combination of choices, scored by the claims.

First every combination, with the constants as inferred and refined; then the best of them with the choices that only
acceleration or the measure knows of, and with ideal sets searched under each.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, get_args, get_type_hints

import numpy as np

from hexmj.controllers.cruse1998 import ModelVariant, Order
from hexmj.io import attributes
from hexmj.legs import CENTRED, FIG1
from hexmj.paper.claims import INFERRED_FROM
from hexmj.paper.protocol import Protocol
from hexmj.paper.scores import score, score_as_is, score_of_ideals, with_stride
from hexmj.progress import part_of, shown
from hexmj.sweep import Cell, Execution, run_cells

if TYPE_CHECKING:
    import xarray as xr

CHOICES: dict[str, tuple[Any, ...]] = {
    "order": get_args(Order),
    **{name: get_args(hint) for name, hint in get_type_hints(ModelVariant).items() if name != "neutral"},
}
"""Choices that every walk depends on, the printed one first; all are combined."""

AS_PRINTED = "as printed"
"""Title of the reading with no other choice."""

ASIDE: dict[str, tuple[Any, ...]] = {
    "neutral": ("present", "final"),
    "looks": ("steps", "periods"),
    "margin": (0.0, 1.0),
}
"""Choices of which only acceleration or the measure knows: combined for the best."""

REFINED, WITH_IDEALS = 3.0, 3.0
"""Work of a score with refined constants, and of one of ideal sets; that of one as it is is 1."""

CALIBRATED = frozenset(key for keys in INFERRED_FROM.values() for key in keys)


def combinations(protocol: Protocol) -> Iterator[Protocol]:
    """A protocol in every combination of `CHOICES`, the printed one first."""
    for chosen in product(*CHOICES.values()):
        yield read(protocol, dict(zip(CHOICES, chosen, strict=True)))


def read(protocol: Protocol, choices: dict[str, Any]) -> Protocol:
    """A protocol with some of its choices, of `CHOICES` and `ASIDE`, made otherwise."""
    of_reading = {name: one for name, one in choices.items() if hasattr(protocol.model_variant, name)}
    of_protocol = {name: one for name, one in choices.items() if name not in of_reading}
    return replace(protocol, **of_protocol, model_variant=replace(protocol.model_variant, **of_reading))


def chosen(protocol: Protocol, name: str) -> Any:
    """A choice of a protocol."""
    return getattr(protocol.model_variant if hasattr(protocol.model_variant, name) else protocol, name)


def title(protocol: Protocol) -> str:
    """What is not read as printed, in words."""
    other = [name for name, choices in (CHOICES | ASIDE).items() if chosen(protocol, name) != choices[0]]
    return ", ".join(f"{name} {chosen(protocol, name)}" for name in other) or AS_PRINTED


def choice_in(title: str, name: str) -> str:
    """A choice of `CHOICES`, from a title."""
    made = {} if title == AS_PRINTED else {one.split()[0]: one.split()[1] for one in title.split(", ")}
    return made.get(name, str(CHOICES[name][0]))


def compare_readings(
    model_variants: Sequence[Protocol], best: int = 12, folder: Path | None = None, **how: Unpack[Execution]
) -> "xr.Dataset":
    """Scores of all readings, and a closer look at the best.

    Args:
        readings: how much is simulated, and how the paper is read; the first as printed.
        best: how many of them are looked at more closely.
        folder: keeps every score; a stopped run goes on where it was.
        how: see `sweeps.Execution`.

    Returns:
        Over reading, constants, claim and observation time: `agrees` and `miss`, see `scores.judged`, and the refined constants.
        Of the best readings, over `best` and `aside`: `aside_agrees`; and over `ideal_claim`: `ideal_agrees`, with
        `ideal_flss` over `ideal_velocity`.
    """
    import xarray as xr

    first, then = REFINED * len(model_variants), best * (math.prod(map(len, ASIDE.values())) - 1 + WITH_IDEALS)
    with shown(how.get("progress"), "model_variant") as told:
        cells = [Cell(title(one), score, {"protocol": one}) for one in model_variants]
        scored = run_cells(cells, folder, **how | {"progress": part_of(told, first / (first + then))})
        scores = xr.concat(scored, xr.Variable("model_variant", [title(one) for one in model_variants]))
        order = ranking(scores)[:best]
        closest = [refined_as(model_variants[i], scores.isel(model_variant=i)) for i in order]
        closer = look_closer(closest, folder, **how | {"progress": part_of(told, then / (first + then))})
    one = model_variants[0]
    settings = {
        "study": "model_variants",
        "starts": one.samples * one.sample,
        "gait_starts": one.gait_starts,
        "seed": one.seed,
        "stride": asdict(one.stride),
        "best": best,
    }
    names = scores.model_variant.values[order]
    return scores.assign(closer).assign_coords(best=names).assign_attrs(attributes(settings))


def look_closer(
    model_variants: Sequence[Protocol], folder: Path | None = None, **how: Unpack[Execution]
) -> "xr.Dataset":
    """Readings with the choices aside, and with ideal sets searched under each; see `compare_readings`."""
    import xarray as xr

    asides = [dict(zip(ASIDE, one, strict=True)) for one in product(*ASIDE.values())][1:]
    looked = [read(one, aside) for one in model_variants for aside in asides]
    cells = [Cell(title(one), score_as_is, {"protocol": one}) for one in looked]
    cells += [Cell(f"ideal {title(one)}", score_of_ideals, {"protocol": one}, WITH_IDEALS) for one in model_variants]
    found = run_cells(cells, folder, **how)
    judged, searched = found[: len(looked)], found[len(looked) :]
    rows = [xr.concat(judged[i : i + len(asides)], "aside").agrees for i in range(0, len(judged), len(asides))]
    names = ["; ".join(f"{name} {one}" for name, one in aside.items() if one != ASIDE[name][0]) for aside in asides]
    ideal = xr.concat(searched, "best").rename(claim="ideal_claim")
    closer = {"aside_agrees": xr.concat(rows, "best").assign_coords(aside=names)}
    return xr.Dataset(closer | {"ideal_agrees": ideal.agrees, "ideal_flss": ideal.flss})


def refined_as(protocol: Protocol, scored: "xr.Dataset") -> Protocol:
    """A protocol with the constants that were found for it."""
    lengths = {name: scored[name].item() for name in ("aep0", "pep0", "pep_min")}
    stride = replace(protocol.stride, **lengths, geometry=CENTRED if scored.centred.item() else FIG1)
    return with_stride(protocol, stride)


def agreeing(scores: "xr.Dataset", held_out: bool = True) -> "xr.DataArray":
    """How many claims agree, of those that were held out or of the calibrated ones, over the other axes."""
    kept = [key for key in scores.claim.values if (key not in CALIBRATED) == held_out]
    return (scores.agrees.sel(claim=kept) == 1).sum("claim")


def ranking(scores: "xr.Dataset") -> np.ndarray:
    """Places of the readings, (reading,), the best first.

    More held-out claims agree, with the constants as inferred, in the better observation time; among equals, less is missed.
    """
    count = agreeing(scores).sel(constants="inferred").max("observation_time").values
    miss = scores.miss.sel(constants="inferred").sum("claim").min("observation_time").values
    return np.lexsort((miss, -count))


def effects(scores: "xr.Dataset", model_variants: Sequence[Protocol]) -> "xr.DataArray":
    """What a choice alone changes: the mean over all others of held-out claims that agree, (choice, observation time).

    The constants are those inferred.
    """
    import xarray as xr

    count = agreeing(scores).sel(constants="inferred")
    rows = {}
    for name, choices in CHOICES.items():
        of = np.array([choices.index(chosen(one, name)) for one in model_variants])
        for i in sorted(set(of.tolist())):
            rows[f"{name} {choices[i]}"] = count.isel(model_variant=np.flatnonzero(of == i)).mean("model_variant")
    values = np.stack([row.values for row in rows.values()])
    return xr.DataArray(
        values, {"choice": list(rows), "observation_time": count.observation_time}, ("choice", "observation_time")
    )


def gained(scores: "xr.Dataset", model_variant: str, observation_time: str) -> tuple[list[str], list[str]]:
    """Held-out claims that agree under a reading but not as printed, and the reverse; constants as inferred."""
    kept = [key for key in scores.claim.values if key not in CALIBRATED]
    at = scores.agrees.sel(claim=kept, observation_time=observation_time, constants="inferred") == 1
    one, printed = at.sel(model_variant=model_variant).values, at.sel(model_variant=AS_PRINTED).values
    keys = np.array(kept)
    return keys[one & ~printed].tolist(), keys[printed & ~one].tolist()
