"""Sets of weights under every variant of what the paper leaves open: which are good whatever the authors used?"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hexmj.checks import check_types, given, printable, typed
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.errors import InputError
from hexmj.io import attributes, settings
from hexmj.legs import GEOMETRIES
from hexmj.measures.frequency import over_start
from hexmj.measures.kinematic import first_loss
from hexmj.measures.velocities import observed, velocity_axis
from hexmj.plain import plain
from hexmj.starts import check_draw, draw_starts
from hexmj.stats import wilson_intervals
from hexmj.sweep import Cell, over_axes
from hexmj.timing import Acceleration, Stride
from hexmj.variants import UNREACHED, instead, naming, variants, varied

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Variants:
    """The same random numbers for the starts of every set, variant and velocity; a cell for each."""

    networks: Mapping[str, Sequence[Cruse1998]]
    """By the names under which they stand in the result, one for each velocity."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """V_r (when accelerating, its final value), each 0 <= V < 1."""
    n_starts: int = 2000
    """Number of starts."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    seed: int = 0
    """Of the starts."""
    stride: Stride | None = None
    """Usual step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""
    conditions: Conditions | None = None
    """Of physical walks, whose falls are counted, without the variants of `UNREACHED`; None counts losses on paper."""

    def __post_init__(self) -> None:
        check_types(self)
        check_draw(self.n_starts, self.seed)
        if self.conditions:
            check_ground(self.conditions)
        if not self.networks:
            raise InputError("no network was given; expected at least one")
        for name, networks in self.networks.items():
            printable("a network's name", name)
            typed(f"networks of {name}", networks, Sequence[Cruse1998])
            if len(networks) != len(self.velocities):
                raise InputError(f"{name}: {len(networks)} networks; expected one for each of {self.velocities}")
        _ = self.times

    @property
    def variants(self) -> list[str]:
        """Names of the variants that are walked."""
        return variants(physical=self.conditions is not None)

    @property
    def strides(self) -> dict[str, Stride]:
        """That of each variant."""
        return {name: varied(given("stride", self.stride, Stride), name) for name in self.variants}

    @property
    def times(self) -> np.ndarray:
        """Observation times, (variant, velocity) [time units]."""

        def time(variant: str) -> np.ndarray:
            with naming(variant):
                return observed(self.velocities, self.observation_time, self.strides[variant], self.acceleration)[1]

        return np.array([time(variant) for variant in self.variants])

    def cells(self) -> list[Cell]:
        """See `sweep.Study`."""
        same = {name: getattr(self, name) for name in ("n_starts", "seed", "acceleration", "conditions")}
        times, velocities = dict(zip(self.variants, self.times.tolist(), strict=True)), list(self.velocities)

        def cell(name: str, variant: str, i: int) -> Cell:
            time, stride = times[variant][i], self.strides[variant]
            own = {"network": varied(self.networks[name][i], variant), "velocity": velocities[i], "duration": time}
            work = time / stride.dt
            return Cell(f"{name}-{variant}-V-{velocities[i]:g}", losses, same | own | {"stride": stride}, work)

        return [cell(*one) for one in product(self.networks, self.variants, range(len(velocities)))]

    def result(self, data: "Sequence[xr.Dataset]") -> "xr.Dataset":
        """How often each set loses stability, and what this comes to over all variants.

        Returns:
            Over (network, variant, velocity): `flss` with its 95 % Wilson interval, over the starts too `lost`; and
            `instead`, the default that was walked where a set has the variant already, empty elsewhere.  Over
            (network, velocity): `mean` and `worst` over the variants with their intervals, that of the mean of the mean
            count, rounded, and too wide rather than too narrow: as if all variants lost the same starts; and the name
            of the worst, `worst_variant`.
        """
        sizes = {"network": len(self.networks), "variant": len(self.variants), "velocity": len(self.velocities)}
        times = {"units": "time unit", "long_name": "observation time t"}
        table = over_axes(sizes, data).assign_coords(
            network=list(self.networks),
            variant=self.variants,
            velocity=velocity_axis(np.array(self.velocities), self.times[0])["velocity"],
            duration=(("variant", "velocity"), self.times, times),
        )
        lost = table.lost.sum("start")
        frequencies = {"flss": lost, "mean": lost.mean("variant"), "worst": lost.max("variant")}
        for name, count in frequencies.items():
            low, high = wilson_intervals(np.rint(count.values), self.n_starts)
            for end, values in {"": count.values / self.n_starts, "_low": low, "_high": high}.items():
                table[name + end] = count.copy(data=values).assign_attrs(units="1")
        table["worst_variant"] = lost.idxmax("variant").assign_attrs(units="1")
        table["instead"] = lost.copy(data=self._instead()).assign_attrs(units="1")
        told = ("observation_time", "n_starts", "seed", "acceleration", "networks")
        settings = {name: plain(getattr(self, name)) for name in told}
        settings["stride"] = asdict(self.strides["usual"])
        settings["conditions"] = self.conditions.settings() if self.conditions else None
        return table.assign_attrs(attributes({"study": "variants"} | settings))

    def _instead(self) -> np.ndarray:
        """See `result`, (network, variant, velocity)."""
        usual = given("stride", self.stride, Stride)

        def told(network: Cruse1998, variant: str) -> str:
            return ", ".join(
                f"{name} = {next((key for key, one in GEOMETRIES.items() if one == value), value)}"
                for name, value in (instead(usual, variant) | instead(network, variant)).items()
            )

        return np.array([
            [[told(one, variant) for one in networks] for variant in self.variants]
            for networks in self.networks.values()
        ])  # fmt: skip


def notes(result: "xr.Dataset") -> list[str]:
    """Sentences on variants that are left out, and on the rows of a result whose name says what a set has anyway."""
    told = []
    if settings(result).get("conditions") is not None:
        names = ", ".join(sorted(UNREACHED))
        told.append(f"without {names}, which the stick insect's legs do not reach on their usual lines")
    for variant in result.variant.values:
        row = result.instead.sel(variant=variant)
        for default in sorted({*row.values.ravel().tolist()} - {""}):
            names = row.network.values[(row == default).any("velocity").values]
            told.append(f"* {variant} is usual for {', '.join(names)}: walked with {default} instead")
    return told


def losses(
    network: Cruse1998,
    velocity: float,
    duration: float,
    *,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None = None,
    conditions: Conditions | None = None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Which starts lose static stability on paper, or fall, as `lost`, 0 or 1, over start.

    Arguments are as of `WalkSettings`; without conditions the network walks on paper.
    """
    if conditions:
        from hexmj.measures.outcome_table import settled_starts
        from hexmj.measures.physical import physical_outcomes

        settled = settled_starts(n_starts, seed, conditions, stride, threads, conditions.body.mjcf.read_bytes())
        how = {"acceleration": acceleration, "threads": threads}
        time = physical_outcomes(settled, network, velocity, duration, **how).fall
    else:
        starts = draw_starts(n_starts, seed, stride)
        how = {"stride": stride, "acceleration": acceleration, "threads": threads}
        time = first_loss(starts, network, velocity, duration, **how)
    return over_start({"lost": np.isfinite(time).astype(np.int8)})
