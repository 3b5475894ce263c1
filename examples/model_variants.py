"""Test claims of the 1998 paper under each combination of the rules that the paper leaves open.

    python examples/model_variants.py
    python examples/model_variants.py --starts 50 --gait-starts 4 --combinations 3

Every combination of rules walks the published weight sets. The script tests only claims from which no constant was
inferred. The first combination is the one printed in the paper. Repeat the command to resume a stopped run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import tyro
import xarray as xr

from hexmj.controllers.cruse1998 import ModelVariant, Order
from hexmj.io import save
from hexmj.paper.claims import Claim, claims
from hexmj.paper.protocol import Protocol
from hexmj.paper.reproduce import measure
from hexmj.sweep import Cell, run_cells, workers
from hexmj.timing import OBSERVATION_TIMES, Stride

CHOICES: dict[str, tuple[str, ...]] = {
    "order": get_args(Order),
    **{name: get_args(hint) for name, hint in get_type_hints(ModelVariant).items() if name != "neutral"},
}
"""Rules that every walk depends on, and their choices, the printed one first."""

MEASURED = {
    f"{model}{kind}" for model in ("hws", "ldvs") for kind in ("", " late", " accelerated", " regimes", " gaits")
}
"""Measurements that need no search."""


@dataclass(frozen=True)
class ModelVariants:
    """How much is simulated: enough to compare combinations, not to judge a claim."""

    starts: int = 300
    """Random starts of each curve."""
    gait_starts: int = 20
    """Random starts of each gait."""
    seed: int = 1998
    """Seed of the random starts."""
    combinations: int | None = None
    """Number of combinations, by default all 72."""
    processes: int = 1
    """Number of processes."""
    out: Path = Path("results/model_variants")
    """Folder for the result and finished combinations."""

    def protocols(self) -> list[Protocol]:
        """Return a protocol for each combination."""
        protocol = Protocol(
            samples=1,
            sample=self.starts,
            velocities=(0.1, 0.25, 0.4, 0.45, 0.5, 0.6, 0.75, 0.85, 0.9),
            gait_starts=self.gait_starts,
            gait_velocities=(0.1, 0.25, 0.4, 0.7, 0.95),
            seed=self.seed,
            gait_stride=Stride(),
        )
        return [
            replace(protocol, order=order, model_variant=ModelVariant(*rules))  # pyright: ignore[reportArgumentType]
            for order, *rules in list(product(*CHOICES.values()))[: self.combinations]
        ]


def held_out() -> list[Claim]:
    """Return the held-out claims on the published sets."""
    known = MEASURED | {"uncoordinated"}
    needs = {claim: set(claim.rule.quantity.needs) for claim in claims().values() if not claim.calibrates}
    return [claim for claim, names in needs.items() if names and names <= known]


def judged(protocol: Protocol, threads: int | None = None) -> xr.Dataset:
    """Return whether each claim agrees, (claim, observation time); gaits count under both observation times."""
    judged = held_out()
    measured = measure({name for claim in judged for name in claim.rule.quantity.needs}, protocol, threads=threads)
    answers = [claim.answers(measured) for claim in judged]
    agrees = [[bool((a := one.get(time, one.get(""))) and a.agrees) for time in OBSERVATION_TIMES] for one in answers]
    axes = {"claim": [claim.key for claim in judged], "observation_time": list(OBSERVATION_TIMES)}
    return xr.Dataset({"agrees": (("claim", "observation_time"), np.array(agrees))}, axes)


def title(protocol: Protocol) -> str:
    """Return the choices that are not the printed ones."""
    chosen = {"order": protocol.order} | vars(protocol.model_variant)
    return (
        ", ".join(f"{name} {chosen[name]}" for name, all in CHOICES.items() if chosen[name] != all[0]) or "as printed"
    )


def means(counts: xr.DataArray, protocols: Sequence[Protocol]) -> dict[str, np.ndarray]:
    """Return the mean number of claims over all combinations with one choice, (observation time,), by choice."""
    chosen = [{"order": one.order} | vars(one.model_variant) for one in protocols]
    rows = {}
    for name, choices in CHOICES.items():
        for choice in choices:
            if places := [i for i, one in enumerate(chosen) if one[name] == choice]:
                rows[f"{name} {choice}"] = counts.values[places].mean(axis=0)
    return rows


def main(chosen: ModelVariants) -> None:
    """Judge the claims under all combinations, and print the counts."""
    protocols = chosen.protocols()
    cells = [Cell(title(one), judged, {"protocol": one}) for one in protocols]
    with workers(chosen.processes) as executor:
        how: Any = {"executor": executor, "progress": True}
        results = run_cells(cells, chosen.out / "combinations", **how)
    data = xr.concat(results, xr.Variable("combination", [cell.name for cell in cells]), combine_attrs="drop")
    counts = data.agrees.sum("claim")
    print(f"Held-out claims that agree, of {data.sizes['claim']}: observation time {', '.join(OBSERVATION_TIMES)}\n")
    for place in np.argsort(-counts.max("observation_time").values, kind="stable"):
        walk, start = counts.values[place]
        print(f"{walk:4} {start:4}  {cells[place].name}")
    print("\nMean over all combinations with one choice\n")
    for choice, (walk, start) in means(counts, protocols).items():
        print(f"{walk:5.1f} {start:5.1f}  {choice}")
    print(f"\n{save(data, chosen.out / 'model_variants.nc')}")


if __name__ == "__main__":
    main(tyro.cli(ModelVariants, description=__doc__))
