"""Ablation: a whole controller against the same without one mechanism or rule, or with one more, on the same starts."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import VARIED, load_controller
from hexmj.errors import InputError
from hexmj.measures.figures import caption
from hexmj.measures.tables import differences, frequencies, over_cells, velocity_axis
from hexmj.plotting import FEWER, NOTHING, head, heat_map, in_figure, picture
from hexmj.studies.league import MOST_GAIT_STARTS
from hexmj.studies.league_cells import ControllerStudy, EntrantWalks, short_names
from hexmj.sweep import Cell
from hexmj.timing import observation_duration
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

SWITCHES = (*(f"without-{part}" for part in (1, 2, 3, 4, 5)), "with-2", "with-4")
"""Suffixes by which `load_controller` leaves a mechanism or rule of a controller out, or adds one."""

MEASURES = {
    "start": "kinematic loss within two swings",
    "walk": "kinematic loss within three periods",
    "limit": "no statically stable steady-state gait",
    "physical": "fall within three periods",
}
"""Measure -> event whose frequency it is."""

NOTES = f"rows without colour: frequency of the whole; others: change of it; red: more\n* 95 % interval excludes 0; \
{NOTHING} no walk is left; {FEWER} walks diverged or were out of reach"
"""Explanation of the marks in the cells of the figure."""


def wholes(names: Sequence[str]) -> dict[str, Controller]:
    """Return the named controllers, and each with one part left out or added, by short names; see `switched`.

    Raises:
        InputError: two controllers have the same name, or a controller has no mechanisms or rules.
    """
    short = short_names({name: load_controller(name) for name in names})
    several = [switched(name, short[name]) for name in names]
    distinct("controllers", [name for found in several for name in found])
    return {name: controller for found in several for name, controller in found.items()}


def switched(name: str, shown: str = "") -> dict[str, Controller]:
    """Return the whole controller, and the controller changed by each of the `SWITCHES` that apply to it.

    Names in the result begin with `shown`, by default `name`.

    Raises:
        InputError: there is no such controller, or it has no mechanisms or rules.
    """
    shown = shown or name
    found = {shown: load_controller(name)}
    for switch in SWITCHES:
        try:
            found[f"{shown}-{switch}"] = load_controller(f"{name}-{switch}")
        except InputError as error:
            if error.__cause__:
                raise  # the user's own code raised an error
    if len(found) == 1:
        raise InputError(f"controller = {name}; expected a network or Walknet, whose parts can be switched")
    return found


@dataclass(frozen=True)
class Ablation(ControllerStudy):
    """All starts of every controller in kinematic walks, and the first `physical_starts` of them in physical walks.

    A controller with a name such as ldvs-without-3 is compared with its whole, here ldvs, if the whole takes part.
    """

    @property
    def wholes(self) -> list[str]:
        """For each controller, the name of the whole that it is compared with; a whole is compared with itself."""
        names = [(name, VARIED.fullmatch(name)) for name in self.controllers]
        return [part["name"] if part and part["name"] in self.controllers else name for name, part in names]

    def cells(self) -> list[Cell]:
        """Return a cell for each controller, measure and velocity."""
        self.check_walks(self.velocities, self.conditions)
        few = {"limit": min(self.n_starts, MOST_GAIT_STARTS), "physical": min(self.physical_starts, self.n_starts)}
        cells = []
        velocities: list[float] = self.observed[0].tolist()
        for (name, controller), measure, v in product(self.controllers.items(), MEASURES, velocities):
            time = float(observation_duration("start" if measure == "start" else "walk", v, self.stride))
            conditions = self.conditions if measure == "physical" else Conditions()
            same = few.get(measure, self.n_starts), self.seed, conditions, self.stride
            walks = EntrantWalks(controller, v, time, *same)
            own = {"periods": self.periods} if measure == "limit" else {}
            function, cost = {
                "limit": (walks.gaits, 10),
                "physical": (walks.outcomes, 20),
            }.get(measure, (walks.losses, 1))
            cells.append(Cell(f"{name}-{measure}-V-{v:g}", function, own, cost * time))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the frequencies of the events, for wholes and for changed controllers.

        Returns:
            Over (controller, measure, velocity): `frequency` with its 95 % Wilson interval, over `frequency_starts`
            starts; and `more`, `frequency` minus that of the `whole` on the same starts, with its 95 % interval.
        """
        import xarray as xr

        names, dims = list(self.controllers), ("controller", "measure", "velocity")
        sizes = dict(zip(dims, (len(names), len(MEASURES), len(self.velocities)), strict=True))
        found = over_cells(sizes, data)
        lost = found.lost.fillna(found.fell)  # each cell has exactly one of lost, fell, stable
        events = lost.fillna(1.0 - found.stable).values
        wholes = events[[names.index(whole) for whole in self.wholes]]
        table = frequencies("frequency", events, dims) | differences("more", events, wholes, dims)
        axes = {"controller": names, "measure": list(MEASURES), "whole": ("controller", self.wholes)}
        own = {"physical_starts": min(self.physical_starts, self.n_starts), "periods": self.periods}
        result = xr.Dataset(table, axes).assign_coords(velocity_axis(*self.observed))
        return self.labelled(result, "ablate", **own)


def ablation_figure(result: "xr.Dataset") -> "Figure":
    """Draw a row with the frequencies of each whole, and below it rows with the differences of changed controllers."""
    rows, columns = result.sizes["controller"], result.sizes["velocity"]
    deep = 1 if columns <= 4 else 2  # rows of panels
    figure = picture(10.0, 1.2 + deep * (0.8 + 0.2 * rows))
    panels = figure.subplots(deep, len(MEASURES) // deep, sharey=True).ravel()
    wholes = result.controller.values == result.whole.values
    for panel, (measure, title) in zip(panels, MEASURES.items(), strict=True):
        data = result.sel(measure=measure).transpose("controller", "velocity", ...)
        texts = [cell_text(data.isel(controller=row, velocity=v)) for row, v in np.ndindex(rows, columns)]
        shown = np.where(wholes[:, None], np.nan, data.more.values)
        texts = np.reshape(texts, (rows, columns))
        heat_map(panel, result.velocity.values, shown, texts, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        panel.set_title("\n".join(wrap(title, 24)), fontsize=9)
        for row in np.flatnonzero(result.whole.values[1:] != result.whole.values[:-1]):
            panel.axhline(row + 0.5, color="0.3", linewidth=0.8)
    panels[0].set_yticks(range(rows), [in_figure(name) for name in result.controller.values], fontsize=9)
    rises = result.more.sel(measure="physical").fillna(-1.0)
    most = rises.isel(rises.argmax(...))
    change = f"{most.controller.item()}, {most.item():+.2f} at V = {most.velocity:g}"
    heading = f"largest rise of the frequency of falls: {change}"
    physical, gaits = result.attrs["physical_starts"], min(result.attrs["starts"], MOST_GAIT_STARTS)
    head(figure, heading, f"{caption(result)}; {physical} of them in physics, {gaits} for the gait")
    figure.supxlabel(NOTES, fontsize=9)
    return figure


def cell_text(cell: "xr.Dataset") -> str:
    """Return the text in the figure for one controller, measure and velocity: a frequency or difference, and marks."""
    whole = cell.controller.item() == cell.whole.item()
    value = (cell.frequency if whole else cell.more).item()
    if np.isnan(value):
        return NOTHING
    text = f"{value:.2f}" if whole else f"{np.round(value, 2) + 0.0:+.2f}".replace("-", "\N{MINUS SIGN}")
    fewer = cell.measure.item() == "physical" and cell.frequency_starts.item() < cell.attrs["physical_starts"]
    sure = not whole and (cell.more_low.item() > 0 or cell.more_high.item() < 0)
    return text + ("*" if sure else "") + (FEWER if fewer else "")
