"""Controllers without one mechanism or rule, or with one more, beside the whole, on the same starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import load_controller
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.measures.figures import caption
from hexmj.measures.study import Study
from hexmj.measures.tables import FRESH, PERIODS, differences, frequencies, happened, padded, velocity_axis
from hexmj.plotting import head, heat_map, in_figure, picture, velocity_columns
from hexmj.studies.league import REGIMES
from hexmj.studies.league_cells import Entrant, EntrantWalks, short_names
from hexmj.sweep import Cell
from hexmj.validate import distinct, whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

SWITCHES = (*(f"without-{part}" for part in (1, 2, 3, 4, 5)), "with-2", "with-4")
"""Changes of a controller, as `load_controller` names them."""

MEASURES = {
    "start": "kinematic loss within two protractions",
    "walk": "kinematic loss within three periods",
    "limit": "no statically stable steady-state gait",
    "physical": "fall within three periods",
}
"""Measure -> the event that is counted."""

NONE, FEWER = "\N{EN DASH}", "\N{BULLET}"
NOTES = {NONE: "no walk is left", FEWER: "walks are missing that diverged or were out of reach"}
"""Marks of a cell without a number, and of one with missing walks -> their meaning."""


def wholes(names: Sequence[str]) -> dict[str, dict[str, Controller]]:
    """Return the controllers `switched` of each whole, by short names."""
    short = short_names({name: load_controller(name) for name in names})
    return {short[name]: switched(name, short[name]) for name in names}


def switched(name: str, shown: str = "") -> dict[str, Controller]:
    """Return the whole controller and its changes by the `SWITCHES` that make a difference.

    They are named by `shown`, by default the same as `name`.

    Raises:
        InputError: there is no such controller, or it has nothing to switch.
    """
    shown = shown or name
    found = {shown: load_controller(name)}
    for switch in SWITCHES:
        try:
            found[f"{shown}-{switch}"] = load_controller(f"{name}-{switch}")
        except InputError as error:
            if error.__cause__:
                raise  # an error of the user's code
    if len(found) == 1:
        raise InputError(f"controller = {name} has no mechanisms or rules to switch; expected a network or Walknet")
    return found


@dataclass(frozen=True)
class Ablation(Study):
    """The same starts for every controller: all of them in kinematic walks, the first of them in physics."""

    controllers: Mapping[str, Mapping[str, Controller]]
    """Controllers of each whole by name, the whole itself first, as `wholes` returns them."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    physical_starts: int = 100
    """Number of the starts that walk in physics; at most all."""
    periods: int = PERIODS
    """Cycles of every leg until its steady-state gait is measured."""
    n_starts: int = field(default=1000, kw_only=True)
    """Number of random starts of kinematic walks, the same for all."""
    seed: int = field(default=FRESH, kw_only=True)
    """Seed of the random starts."""

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("physical_starts", self.physical_starts, 1)
        whole("periods", self.periods, CYCLES + 2)
        distinct("controllers", [name for several in self.controllers.values() for name in several])
        if not (self.observed[0] > 0).all():
            raise InputError(f"velocities = {self.velocities}; expected each above 0")

    def plans(self) -> Mapping[str, Controller]:
        return {name: controller for several in self.controllers.values() for name, controller in several.items()}

    def cells(self) -> list[Cell]:
        """Return a cell for each controller, measure and velocity."""
        self.check_walks(self.velocities, self.conditions)
        observed = [*zip(*(axis.tolist() for axis in self.observed), strict=True)]
        few = {"limit": min(self.n_starts, REGIMES), "physical": min(self.physical_starts, self.n_starts)}
        cells = []
        for (name, controller), measure, (v, time) in product(self.plans().items(), MEASURES, observed):
            until, n_starts = "start" if measure == "start" else "walk", few.get(measure, self.n_starts)
            walks = EntrantWalks(Entrant(controller), v, until, n_starts, self.seed, self.stride)
            function, own, cost = {
                "limit": (walks.gaits, {"periods": self.periods}, 10),
                "physical": (walks.outcomes, {"controller": controller, "conditions": self.conditions}, 20),
            }.get(measure, (walks.losses, {}, 1))
            cells.append(Cell(f"{name}-{measure}-V-{v:g}", function, own, cost * time))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return how often events happen, with and without parts.

        Returns:
            Over (controller, measure, velocity): `frequency` with its 95 % Wilson interval, of `frequency_starts`, and
            `more`, how far it is above that of the `whole` on the same starts, with its interval.
        """
        import xarray as xr

        names = list(self.plans())
        events = padded([[_events(cell) for cell in data]]).reshape(len(names), len(MEASURES), len(self.velocities), -1)
        whole_of = [whole for whole, several in self.controllers.items() for _ in several]
        wholes = events[[names.index(whole) for whole in whole_of]]
        dims = "controller", "measure", "velocity"
        table = frequencies("frequency", events, dims) | differences("more", events, wholes, dims)
        axes = {"controller": names, "measure": list(MEASURES), "whole": ("controller", whole_of)}
        own = {"physical_starts": min(self.physical_starts, self.n_starts), "periods": self.periods}
        result = xr.Dataset(table, axes).assign_coords(velocity_axis(*self.observed))
        return self.labelled(result, "ablate", **own)


def _events(cell: "xr.Dataset") -> np.ndarray:
    """Return the events that a cell counts, (start,), 0 or 1; NaN for walks that fail."""
    if "lost" in cell:
        return cell.lost.values.astype(float)
    return happened(cell.fall).values if "fall" in cell else 1.0 - cell.stable.values


def ablation_figure(result: "xr.Dataset") -> "Figure":
    """Draw frequencies of the wholes, and below each how much more often events happen without a part."""
    rows, columns = result.sizes["controller"], result.sizes["velocity"]
    figure = picture(2.6 + 0.58 * len(MEASURES) * max(4, columns), 1.9 + 0.27 * rows)
    panels, used = figure.subplots(1, len(MEASURES), sharey=True), set[str]()
    wholes = result.controller.values == result.whole.values
    for panel, (measure, title) in zip(panels, MEASURES.items(), strict=True):
        data = result.sel(measure=measure).transpose("controller", "velocity", ...)
        cells = [cell_text(data.isel(controller=row, velocity=v)) for row, v in np.ndindex(rows, columns)]
        texts, sure = (np.reshape(values, (rows, columns)) for values in zip(*cells, strict=True))
        used |= {mark for mark in NOTES for text, _ in cells if mark in text}
        shown = np.where(wholes[:, None], np.nan, data.more.values)
        heat_map(panel, shown, texts, ~sure, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        panel.set_title(f"{measure}\n{title}", fontsize=9)
        velocity_columns(panel, result.velocity.values)
        for row in np.flatnonzero(result.whole.values[1:] != result.whole.values[:-1]):
            panel.axhline(row + 0.5, color="0.3", linewidth=0.8)
    panels[0].set_yticks(range(rows), [in_figure(name) for name in result.controller.values])
    heading = "What a part buys: frequencies of the whole, and differences without it (bold: 95 % interval excludes 0)"
    physical, gaits = result.attrs["physical_starts"], min(result.attrs["starts"], REGIMES)
    head(figure, heading, f"{caption(result)}; {physical} of them in physics, {gaits} for the gait")
    if used:
        figure.supxlabel("; ".join(f"{mark} {note}" for mark, note in NOTES.items() if mark in used), fontsize=8)
    return figure


def cell_text(cell: "xr.Dataset") -> tuple[str, bool]:
    """Return the text of one controller, measure and velocity, and whether it stands out."""
    whole = cell.controller.item() == cell.whole.item()
    value = (cell.frequency if whole else cell.more).item()
    if np.isnan(value):
        return NONE, False
    text = f"{value:.2f}" if whole else f"{np.round(value, 2) + 0.0:+.2f}".replace("-", "\N{MINUS SIGN}")
    fewer = cell.measure.item() == "physical" and cell.frequency_starts.item() < cell.attrs["physical_starts"]
    sure = whole or cell.more_low.item() > 0 or cell.more_high.item() < 0
    return text + (FEWER if fewer else ""), sure
