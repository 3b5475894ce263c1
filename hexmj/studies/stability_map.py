"""Dynamic stability maps: physical FLSS over velocity and one condition, from the same starts in every cell."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller, FeedbackPlan
from hexmj.errors import InputError
from hexmj.measures.compare import MEASURES
from hexmj.measures.figures import caption
from hexmj.measures.study import UNITS, Study, by_halves, kept_walk, standing_starts
from hexmj.measures.tables import WalkSettings, differences, frequency, happened, over_start, velocity_axis
from hexmj.plotting import LEGEND, NOTHING, head, heat_map, picture
from hexmj.progress import Progress, part_of
from hexmj.stability import loss_time
from hexmj.starts import draw_starts
from hexmj.studies.mechanisms import MECHANISMS, SAVED, fall_direction, mechanisms, static_plan
from hexmj.sweep import Cell, over_axes
from hexmj.timing import Acceleration
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Over = Literal["vp", "step_height", "standing_height", "friction", "load", "centre_of_mass"]
"""Conditions that a map can vary."""


class Axis(NamedTuple):
    """Default values, unit and name of a condition that a map can vary."""

    values: tuple[float, ...]
    unit: str
    name: str


CONDITIONS: dict[Over, Axis] = {
    "vp": Axis((20.0, 40.0, 80.0, 160.0, 320.0), "mm/s", "swing velocity V_p"),
    "step_height": Axis((4.0, 6.0, 8.0, 10.0, 12.0), "mm", "step height"),
    "standing_height": Axis((6.0, 8.0, 10.0, 12.0, 14.0), "mm", "standing height"),
    "friction": Axis((0.05, 0.2, 0.5, 1.0, 2.0), "1", "friction"),
    "load": Axis((0.0, 0.5, 1.0, 1.5, 2.0), "own weight", "load"),
    "centre_of_mass": Axis((-9.4, -5.0, 0.0, 5.0, 10.0), "mm", "centre of mass ahead of O"),
}
"""Condition -> its default values, unit and name; the animal's own centre of mass lies at -9.4 mm."""

FLSS = MEASURES | {"static": "static_loss"}
"""Measure -> outcome, the time of the event that it counts. `static` counts losses of the planned polygon around the
body's own centre of mass; `kinematic` counts those around O, which are the same under all conditions."""

BLOCK = 100
"""Number of starts walked at a time; all steps of their walks are in memory, 0.5 GB at V = 0.1."""

LOOKS: dict[str, tuple[str, str | None, str]] = {
    "never_lost": ("#e4e4e4", None, "no planned loss, no fall"),
    "still_standing": ("#cde8c9", None, "saved: feet that carry load never lost it"),
    "too_short": ("#8fce8a", None, "saved: trunk never tipped"),
    "landed_in_time": ("#46a35e", None, "saved: planned feet landed in time"),
    "caught": ("#14663a", None, "saved: caught by a swinging foot"),
    "tipped_behind": ("#f5a25d", "//", "fell backwards at a planned loss"),
    "tipped_ahead": ("#f6d55c", "\\\\", "fell ahead at a planned loss"),
    "thrown": ("#b3261e", "xx", "fell: thrown over by a leg"),
    "unplanned": ("#6a4c93", "..", "fell at a wide planned margin"),
    "narrow": ("#b79bd6", "--", "fell at a narrow planned margin"),
}
"""Mechanism -> colour, hatch, label: grey without loss and fall, green for a survived loss, red to yellow for a fall
after a planned loss, violet for another fall. Falls are hatched, for readers without colours."""


@dataclass(frozen=True)
class StabilityMap(Study):
    """Physical walks from the same starts at every value of one condition and every velocity.

    The controller must not use sensory feedback, since mechanisms are derived from the plan alone. The result contains
    the starts that stand on six feet at every value and reach nine of ten foot targets in every cell.
    """

    controller: Controller
    """Controller that plans the walks, without sensory feedback."""
    over: Over = "vp"
    """Condition that is varied."""
    values: Sequence[float] = ()
    """Values of the varied condition in its unit; by default five values that depend on the condition."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; the final velocities when accelerating."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11; without it the velocity is constant."""

    def __post_init__(self) -> None:
        choice("over", self.over, CONDITIONS)
        super().__post_init__()
        start, v = draw_starts(1, self.seed, self.stride), self.observed[0][:1]
        if isinstance(begin(self.controller, start, v, self.stride, self.acceleration, threads=1), FeedbackPlan):
            raise InputError(f"controller = {self.controller.name}; expected a controller without sensory feedback")

    @property
    def varies(self) -> Mapping[str, Sequence[float]]:
        """The varied condition -> `values`, or the default values."""
        return {self.over: [float(value) for value in self.values or CONDITIONS[self.over].values]}

    def cells(self) -> list[Cell]:
        """Return a cell for each value and velocity, computed by `fates`."""
        self.check_walks(self.velocities, *self.varied)
        cells = []
        for value, conditions in zip(self.varies[self.over], self.varied, strict=True):
            for v, time in zip(*self.observed, strict=True):
                walks = self.walks(v, time, conditions)
                own, work = {"walks": walks, "over": self.over}, walks.work * conditions.substeps(self.stride)
                cells.append(Cell(f"{self.over}-{value:g}-V-{v:g}", fates, own, work))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return outcomes, frequencies, and differences between measures and between values of the condition.

        Returns:
            Over (value, velocity): the frequencies `FLSS`, and `saved`, the fraction of starts with a static loss that
            do not fall, with 95 % Wilson intervals; the differences `dynamics`, physical minus static FLSS, and
            `change`, physical FLSS minus that at the value `attrs["reference"]`, on the same starts, with 95 %
            intervals; the Froude number `froude`. Over (value, velocity, mechanism_name): `count` of starts. Over
            (value, velocity, start): `static_loss`, `mechanism` (index), `direction` of the fall [rad] and every field
            of `Outcomes`. Over value: `stand`, the number of starts that stand and reach the targets at each velocity.

        Raises:
            InputError: no start stands and reaches nine of ten foot targets in every cell.
        """
        values, axis = self.varies[self.over], CONDITIONS[self.over]
        sizes = {"value": len(values), "velocity": len(self.velocities)}
        table = over_axes(sizes, data, join="inner", combine_attrs="override")
        if not table.sizes["start"]:
            at = f"{self.over} = {values}"
            raise InputError(f"{at}: no start stands and reaches nine of ten foot targets at every value and velocity")
        left, columns = [set(cell.start.values.tolist()) for cell in data], sizes["velocity"]
        stand = [len(set.intersection(*left[i : i + columns])) for i in range(0, len(left), columns)]
        default = Conditions().values()[self.over]
        reference = default if default in values else values[0]
        numbers = np.stack([froude(conditions, self.observed[0]) for conditions in self.varied])
        table = table.assign_coords(
            **velocity_axis(*self.observed),
            value=("value", values, {"units": axis.unit, "long_name": axis.name}),
            mechanism_name=("mechanism_name", list(MECHANISMS)),
        ).assign(
            stand=("value", stand, {"units": "1", "long_name": "starts that stand and reach nine of ten tips"}),
            froude=(("value", "velocity"), numbers, {"units": "1"}),
        )
        return self.labelled(with_differences(table, reference), "map", over=self.over, reference=reference)


def fates(walks: WalkSettings, over: str, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
    """Return loss, fall and mechanism of every start in one cell of a map over the condition `over`.

    Starts that cannot stand on six feet, or reach less than nine of ten foot targets, are left out.

    Returns:
        Over start: every field of `Outcomes`, `static_loss`, `mechanism` (index) and `direction` of the fall [rad].

    Raises:
        InputError, SimulationError: all starts are left out, or a walk diverges.
    """
    stands = standing_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads)
    blocks = np.split(stands, range(BLOCK, len(stands), BLOCK)) if stands.size else ()

    def fate(which: np.ndarray) -> dict[str, np.ndarray]:
        part = part_of(progress, len(which) / len(stands))
        walk = kept_walk(walks, walks.starts[which], threads=threads, progress=part)
        static = {"static_loss": loss_time(static_plan(walk), threads=threads)}
        return vars(walk.outcomes) | static | {"mechanism": mechanisms(walk), "direction": fall_direction(walk)}

    parts = [part for block in blocks for part in by_halves(block, fate)]
    if not parts:
        where = f"{over} = {walks.conditions.values()[over]:g}"
        raise InputError(f"{where}: no start stands and reaches nine of ten foot targets at V = {walks.velocity:g}")
    columns = {name: np.concatenate([part[name] for _, part in parts]) for name in parts[0][1]}
    within = np.concatenate([which for which, _ in parts])
    return over_start(columns, UNITS | {"static_loss": "time unit", "direction": "rad"}).assign_coords(
        start=("start", within, {"units": "1"})
    )


def with_differences(data: "xr.Dataset", reference: float) -> "xr.Dataset":
    """Add the frequencies, differences and counts that `StabilityMap.result` describes to the outcomes of its cells."""
    cells = ("value", "velocity")
    events = {name: happened(data[outcome]).transpose(*cells, "start").values for name, outcome in FLSS.items()}
    fell, static = events["physical"], events["static"]
    new: dict[str, Any] = {}
    for measure, lost in (events | {"saved": np.where(static == 1.0, 1.0 - fell, np.nan)}).items():
        new |= frequency(measure, lost, cells)
    row = data.value.values.tolist().index(reference)
    new |= differences("dynamics", fell, static, cells) | differences("change", fell, fell[row], cells)
    names = data.mechanism.transpose(*cells, "start").values
    count = np.stack([(names == number).sum(axis=-1) for number in range(len(MECHANISMS))], axis=-1)
    new["count"] = ((*cells, "mechanism_name"), count, {"units": "1", "long_name": "number of starts"})
    return data.assign(new)


def froude(conditions: Conditions, velocity: np.ndarray) -> np.ndarray:
    """Return the Froude number (V V_p)^2 / (g h) at each V_r, (velocity,); h is the standing height."""
    from hexmj.bodies.mjcf import gravity

    return (velocity * conditions.vp) ** 2 / (gravity(conditions.body) * conditions.standing_height)


def map_figure(result: "xr.Dataset") -> "Figure":
    """Draw two heat maps over velocity and condition: falls, and the fraction of static losses without a fall.

    The lowest row shows the kinematic FLSS, which is the same under all conditions."""
    result = result.transpose("value", "velocity", "start", ...)
    rows, columns = result.sizes["value"], result.sizes["velocity"]
    figure = picture(max(8.0, 2.4 + 2.0 * columns), 1.9 + 0.5 * (rows + 1))
    panels = figure.subplots(1, 2, sharey=True)
    unknown = np.full((1, columns), np.nan)  # no condition changes kinematic walks
    falls = np.concatenate([result.kinematic.values[:1], result.physical.values])
    words = [[f"{number:.2f}" for number in row] for row in falls]
    saved = result["count"].sel(mechanism_name=list(SAVED)).sum("mechanism_name").values
    counts = zip(saved.ravel(), np.isfinite(result.static_loss.values).sum(axis=-1).ravel(), strict=True)
    of_lost = np.reshape([""] * columns + [f"{n}/{lost}" if lost else NOTHING for n, lost in counts], falls.shape)
    drawn = {
        "frequency of falls": (falls, words, "YlOrRd"),
        "static losses survived / all": (np.concatenate([unknown, result.saved.values]), of_lost, "YlGn"),
    }
    v, style = result.velocity.values, {"vmin": 0.0, "vmax": 1.0, "origin": "lower"}
    for axes, (title, (numbers, texts, colours)) in zip(panels, drawn.items(), strict=True):
        heat_map(axes, v, numbers, np.array(texts), cmap=colours, **style)
        axes.axhline(0.5, color="white", linewidth=9.0)
        axes.set_title(title, fontsize=11)
    panels[0].set_yticks(range(rows + 1), ["kinematic FLSS", *(f"{value:g}" for value in result.value.values)])
    panels[0].set_ylabel(_label(result))
    static = f"static loss: the body's centre of mass leaves the planned polygon; {NOTHING} none"
    head(figure, _finding(result), _caption(result), static)
    return figure


def mechanisms_figure(result: "xr.Dataset") -> "Figure":
    """Draw the fraction of starts with each mechanism as stacked bars over the condition, a panel for each velocity."""
    columns, values = result.sizes["velocity"], range(result.sizes["value"])
    figure = picture(max(8.0, 3.6 + 1.7 * columns), 4.6)
    panels = figure.subplots(1, columns, sharey=True, squeeze=False)[0]
    for panel, v in zip(panels, result.velocity.values, strict=True):
        shares, bottom = result["count"].sel(velocity=v) / result.sizes["start"], np.zeros(len(values))
        for name, (colour, hatch, label) in LOOKS.items():
            share = shares.sel(mechanism_name=name).values
            style = {"color": colour, "hatch": hatch, "edgecolor": "0.25", "linewidth": 0.0}
            panel.bar(values, share, 0.82, bottom, label=label, **style)
            bottom = bottom + share
        panel.set_title(f"V = {v:g}", fontsize=11)
        panel.set_xticks(values, [f"{value:g}" for value in result.value.values], fontsize=9)
        panel.set(ylim=(0.0, 1.0), xlabel=_label(result).replace(" [", "\n["))
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("share of the starts")
    handles, _ = panels[0].get_legend_handles_labels()
    figure.legend(handles=handles[::-1], **LEGEND, loc="outside right center")
    head(figure, _finding(result), _caption(result), "hatched: fell")
    return figure


def _finding(result: "xr.Dataset") -> str:
    """Return the falls at the first and the last value of the condition, at the velocity where they differ most."""
    falls, values = result.physical.transpose("value", "velocity").values, result.value.values
    name, _, unit = _label(result).removeprefix("swing velocity ").removesuffix("]").partition(" [")
    v = np.abs(np.nan_to_num(falls[-1] - falls[0])).argmax()
    ends = " and ".join(f"{falls[i, v]:.2f} at {name} = {values[i]:g} {unit}".strip() for i in (0, -1))
    return f"at V = {result.velocity.values[v]:g}, the frequency of falls is {ends}"


def _caption(result: "xr.Dataset") -> str:
    return f"{caption(result)}; {result.sizes['start']} of them stand and reach nine of ten tips at every value"


def _label(result: "xr.Dataset") -> str:
    name, unit = result.value.attrs["long_name"], result.value.attrs["units"]
    return name.replace("V_p", "$V_p$") + (f" [{unit}]" if unit != "1" else "")
