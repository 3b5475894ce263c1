"""FLSS of weight sets with one change at a time to a constant or rule that the paper leaves open.

    python examples/variants.py
    python examples/variants.py --controllers ldvs own-V --velocities 0.3 0.5 --physical --n-starts 20

`own-V` stands for the weight set of each velocity, such as `own-0.3` at V = 0.3. If a weight set already has the
changed value, it walks with the default value instead, and its FLSS has an asterisk.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tyro
import xarray as xr

import hexmj
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.errors import InputError
from hexmj.sweep import Cell, over_axes, run_study
from hexmj.timing import observation_duration
from hexmj.variants import VARIANTS, variants, varied


@dataclass(frozen=True)
class Variants:
    """The same random numbers for the starts of every set, variant and velocity; a cell for each."""

    controllers: tuple[str, ...] = ("hws", "ldvs", "own", "own-V")
    """Weight sets of the 1998 network."""
    velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 <= V < 1."""
    n_starts: int = 0
    """Number of random starts, by default 2000, or 50 if physical."""
    observation_time: str = "walk"
    """Observation time: 'walk', 'start' or a number [time units]."""
    seed: int = 0
    """Seed of the random starts."""
    physical: bool = False
    """Count falls in MuJoCo instead of planned losses, without the variant AEP0 11."""
    out: Path = field(default=Path("results/variants"))
    """Folder for the result and finished walks."""

    @property
    def starts(self) -> int:
        """Number of starts."""
        return self.n_starts or (50 if self.physical else 2000)

    @property
    def names(self) -> list[str]:
        """Names of the variants."""
        return variants(self.physical)

    def network(self, name: str, velocity: float) -> Cruse1998:
        """Return a set, or that of this velocity."""
        name = f"{name.removesuffix('V')}{velocity:g}" if name.endswith("-V") else name
        found = hexmj.load_controller(name)
        if not isinstance(found, Cruse1998):
            raise InputError(f"controller = {name}; expected a weight set of the 1998 network")
        return found

    def cells(self) -> list[Cell]:
        """Return a cell for each set, variant and velocity."""

        def cell(name: str, variant: str, velocity: float) -> Cell:
            stride = varied(hexmj.Stride(), variant)
            number = self.observation_time.replace(".", "", 1).isdigit()
            time = float(self.observation_time) if number else self.observation_time
            own: dict[str, Any] = {"controller": varied(self.network(name, velocity), variant), "stride": stride}
            own |= {"duration": float(observation_duration(time, velocity, stride)), "velocity": velocity}
            same = {"n_starts": self.starts, "seed": self.seed, "physical": self.physical}
            return Cell(f"{name}-{variant}-V-{velocity:g}", losses, own | same, own["duration"] / stride.dt)

        return [cell(name, one, v) for name in self.controllers for one in self.names for v in self.velocities]

    def result(self, data: Sequence[xr.Dataset]) -> xr.Dataset:
        """Return `flss` over (controller, variant, velocity), and where a set had a variant anyway, `had`."""
        axes = {"controller": list(self.controllers), "variant": self.names, "velocity": list(self.velocities)}
        table = over_axes({name: len(values) for name, values in axes.items()}, data).assign_coords(axes)

        def has(name: str, variant: str, velocity: float) -> bool:
            network, changed = self.network(name, velocity), VARIANTS[variant]
            return bool(changed) and changed.items() <= (vars(network) | vars(network.model_variant)).items()

        had = [[[has(name, one, v) for v in self.velocities] for one in self.names] for name in self.controllers]
        return xr.Dataset({"flss": table.lost.mean("start"), "had": (list(axes), had)})


def losses(
    controller: Cruse1998,
    velocity: float,
    duration: float,
    stride: hexmj.Stride,
    n_starts: int,
    seed: int,
    physical: bool,
    threads: int | None = None,
) -> xr.Dataset:
    """Return which starts lose static stability, or fall, as `lost` over start."""
    starts = hexmj.draw_starts(n_starts, seed, stride)
    how: Any = {"stride": stride, "threads": threads}
    if physical:
        time = hexmj.physical_walk(starts, controller, velocity, duration, **how).outcomes.fall
    else:
        time = hexmj.first_loss(starts, controller, velocity, duration, **how)
    return xr.Dataset({"lost": ("start", np.isfinite(time))})


def main(study: Variants) -> None:
    """Run the study, print a table for each velocity, and save the result."""
    result = run_study(study, study.out / "walks", progress=True)
    hexmj.save(result, study.out / "variants.nc")
    kind = "physical" if study.physical else "kinematic"
    for v in study.velocities:
        data = result.sel(velocity=v)
        print(f"\n{kind} FLSS at V = {v:g}, {study.starts} starts", *(f"{name:>14}" for name in study.controllers))
        for variant in study.names:
            row = data.sel(variant=variant)
            numbers = zip(row.flss.values, row.had.values, strict=True)
            print(f"{variant:35}", *(f"{flss:13.4f}{'*' if had else ' '}" for flss, had in numbers))
        print(f"{'mean':35}", *(f"{flss:13.4f} " for flss in data.flss.mean("variant").values))
        print(f"{'worst':35}", *(f"{flss:13.4f} " for flss in data.flss.max("variant").values))


if __name__ == "__main__":
    main(tyro.cli(Variants, description=__doc__))
