"""The animal beside the machine: what the walking insect's legs and body do, beside what was measured in insects."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from hexmj.checks import whole
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.intervals import WILSON_Z
from hexmj.studies.biology.animals import ANIMALS, SPEEDS
from hexmj.studies.same_starts import SameStarts
from hexmj.sweeps import Cell
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr

MEASURED = 3
"""Periods of a single leg at the end of a walk that are measured, as far as they are whole strides."""


@dataclass(frozen=True)
class Biology(SameStarts):
    """The same starts at every speed at which the animal was measured."""

    periods: int = 30
    """Of a single leg; so long do the starts walk, until they have found their gait."""
    n_starts: int = field(default=20, kw_only=True)
    window: str = field(default="periods", init=False)
    """All walk so many periods."""
    acceleration: None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("periods", self.periods, MEASURED + 1, 1000)
        vp = self.conditions.time.vp
        if not max(SPEEDS) < vp:
            raise InputError(f"vp = {vp}; expected more than {max(SPEEDS):g} mm/s, the fastest walk that is compared")
        if self.conditions.contact.grasp:
            raise InputError(f"grasp = {self.conditions.contact.grasp}; expected 0, since adhesion is no ground force")

    def cells(self) -> list[Cell]:
        """A cell for each speed; see `sweeps.Study`."""

        def cell(speed: float) -> Cell:
            velocity = speed / self.conditions.time.vp
            period = float(self.stride.periods(velocity))
            return self.cell(
                f"{speed:g}-mm-s", measured_quantities, 1 / velocity, velocity=velocity, conditions=self.conditions,
                duration=self.periods * period, measured=MEASURED * period,
            )  # fmt: skip

        return [cell(speed) for speed in SPEEDS]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Ours beside the animals'.

        Returns:
            Over (speed, quantity, start): `value`, NaN where a start fell.  Over row, one for each of `ANIMALS`: its
            `name`, `unit`, `at` which speed and whether the animals' figure `depends` on it; our `mean` over the starts
            with its 95 % interval `low`, `high`; the animals' `animal_low`, `animal_high` and their `source`; the
            `verdict`, and whether it was `built_in`.
        """
        import xarray as xr

        from hexmj.studies.biology.quantities import UNITS

        table = xr.concat(list(data), "speed").assign_coords(speed=("speed", list(SPEEDS), {"units": "mm/s"}))
        ours = [_mean(table.value.sel(speed=row.speed, quantity=row.quantity).values) for row in ANIMALS]
        columns = {
            "name": [row.quantity for row in ANIMALS],
            "unit": [UNITS[row.quantity] for row in ANIMALS],
            "at": [row.speed for row in ANIMALS],
            "depends": [row.depends for row in ANIMALS],
            **dict(zip(("mean", "low", "high"), np.transpose(ours), strict=True)),
            "animal_low": [row.low for row in ANIMALS],
            "animal_high": [row.high for row in ANIMALS],
            "verdict": [row.verdict(mean) for row, (mean, _, _) in zip(ANIMALS, ours, strict=True)],
            "built_in": [row.built_in for row in ANIMALS],
            "source": [row.source for row in ANIMALS],
        }
        told = {name: ("row", values, {"units": "mm/s" if name == "at" else "1"}) for name, values in columns.items()}
        return table.assign(told).assign_attrs(self.attributes(periods=self.periods, speeds=list(SPEEDS)))


def measured_quantities(
    controller: Controller,
    velocity: float,
    duration: float,
    measured: float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    acceleration: Acceleration | None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Every quantity of every start, over (quantity, start); NaN where the start fell.

    Args:
        controller: plans the walks.
        velocity: V_r.
        duration: of the walks [time units].
        measured: how much of it counts, at its end [time units].
        n_starts: number of starts.
        seed: of the starts.
        conditions: of the walks.
        stride: step range, lines of the tips and time step.
        acceleration: none.
        threads: one per core unless given; the table does not depend on it.
    """
    import xarray as xr

    from hexmj.physics.settling import settle
    from hexmj.starts import draw_starts
    from hexmj.studies.biology.quantities import UNITS, quantities
    from hexmj.studies.biology.strides import last_strides

    settled = settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)
    values = np.full((len(UNITS), n_starts), np.nan)
    for start, strides in last_strides(settled, controller, velocity, duration, measured, threads):
        values[:, start] = list(quantities(strides, settled.compiled).values())
    return xr.Dataset({"value": (("quantity", "start"), values, {"units": "of the quantity"})}, {"quantity": [*UNITS]})


def _mean(values: np.ndarray) -> tuple[float, float, float]:
    """Mean of those that are known, and its 95 % interval."""
    known = values[np.isfinite(values)]
    if len(known) < 2:
        return (float(known.mean()) if len(known) else np.nan), np.nan, np.nan
    middle, half = known.mean(), WILSON_Z * known.std(ddof=1) / np.sqrt(len(known))
    return middle, middle - half, middle + half
