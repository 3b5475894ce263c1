"""The animal beside the machine: what the walking insect's legs and body do, beside what was measured in insects."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from hexmj.checks import whole
from hexmj.controllers.checked_plans import check_velocities
from hexmj.errors import InputError
from hexmj.phases import unrolled
from hexmj.studies.biology.animals import ANIMALS, SPEEDS
from hexmj.studies.biology.names import PHASES, UNITS
from hexmj.studies.same_starts import SameStarts
from hexmj.sweep import Cell

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
    observation_time: str = field(default="periods", init=False)
    """All walk so many periods."""
    acceleration: None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("periods", self.periods, MEASURED + 1, 1000)
        vp = self.conditions.vp
        if not max(SPEEDS) < vp:
            raise InputError(f"vp = {vp}; expected more than {max(SPEEDS):g} mm/s, the fastest walk that is compared")
        if (kind := self.conditions.ground) != "flat":
            raise InputError(
                f"ground = {kind}; expected flat: the last strides are measured, far beyond what lies ahead"
            )
        if self.conditions.grasp:
            raise InputError(f"grasp = {self.conditions.grasp}; expected 0, since adhesion is no ground force")

    def cells(self) -> list[Cell]:
        """A cell for each speed; see `sweep.Study`."""
        from hexmj.studies.biology.quantities import quantity_table

        def cell(speed: float) -> Cell:
            velocity = speed / self.conditions.vp
            period = float(self.stride.periods(velocity))
            walks = self.walks(velocity, self.periods * period, self.conditions)
            own = {"walks": walks, "measured": MEASURED * period}
            return Cell(f"{speed:g}-mm-s", quantity_table, own, 1 / velocity)

        check_velocities(self.controller, np.divide(SPEEDS, self.conditions.vp).tolist(), self.stride)
        return [cell(speed) for speed in SPEEDS]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Ours beside the animals'.

        Returns:
            Over (speed, quantity, start): `value`, NaN where a start fell or made no whole stride.  Over row, one for
            each of `ANIMALS`: its `name`, `unit`, `at` which speed and whether the animals' figure `depends` on it; our
            `mean` over the starts with its 95 % interval `low`, `high`; the animals' `animal_low`, `animal_high` and
            their `source`; the `verdict` on our mean alone, and whether it was `built_in`; and of how many starts
            it is (`walked`).
        """
        import xarray as xr

        table = xr.concat(list(data), "speed").assign_coords(speed=("speed", list(SPEEDS), {"units": "mm/s"}))
        values = [table.value.sel(speed=row.speed, quantity=row.quantity).values for row in ANIMALS]
        ours = [_mean(one, row.quantity) for one, row in zip(values, ANIMALS, strict=True)]
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
            "walked": [np.count_nonzero(np.isfinite(one)) for one in values],
        }
        measured = dict.fromkeys(("mean", "low", "high", "animal_low", "animal_high"), "of the row")
        units = dict.fromkeys(columns, "1") | {"at": "mm/s"} | measured
        told = {name: ("row", values, {"units": units[name]}) for name, values in columns.items()}
        walked = {"observation_time": f"{self.periods} periods", "periods": self.periods, "speeds": list(SPEEDS)}
        return self.labelled(table.assign(told), "biology", **walked)


def _mean(values: np.ndarray, quantity: str) -> tuple[float, float, float]:
    """Mean of those that are known, and its 95 % interval by Student's t, which of phases may go beyond 0 or 1."""
    known = unrolled(values) if (phase := quantity in PHASES) else values
    known = known[np.isfinite(known)]
    if len(known) < 2:
        return (float(known.mean()) if len(known) else np.nan), np.nan, np.nan
    middle, half = known.mean(), stdtrit(len(known) - 1, 0.975) * known.std(ddof=1) / np.sqrt(len(known))
    middle = middle % 1.0 if phase else middle
    return middle, middle - half, middle + half


def walked(result: "xr.Dataset") -> dict[float, int]:
    """Number of starts that walked whole strides at each speed [mm/s], of a result of `Biology`."""
    count = result.value.sel(quantity="speed").notnull().sum("start")
    return dict(zip(result.speed.values.tolist(), count.values.tolist(), strict=True))


def walked_in_words(result: "xr.Dataset") -> str:
    """The same as a text."""
    return ", ".join(f"{n} of {result.sizes['start']} at {speed:g} mm/s" for speed, n in walked(result).items())
