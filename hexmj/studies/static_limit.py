"""The static limit: does physical walking converge to the plan and to the paper's static criterion as V_p goes to zero?

The same starts walk at decreasing V_p, with the mass of the insect's own legs and with legs of almost no mass, as in
the paper, whose legs have none.

If more than three feet stand, the distribution of the weight over them depends on how far the servos yield. A foot in
stance may hover while other feet carry the weight. The hovering foot is still at the ground (`outcomes.GROUNDED`): it
touches the ground as soon as the trunk sinks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.measures.compare import MEASURES, with_flss
from hexmj.measures.figures import caption
from hexmj.measures.study import UNITS, Study, kept_walk
from hexmj.measures.tables import WalkSettings, over_start
from hexmj.plotting import LEGEND, MEASURE_STYLES, frequency_curve, head, picture, tidy
from hexmj.progress import Progress
from hexmj.stability import loss_time, walk_margin
from hexmj.sweep import Cell, over_axes
from hexmj.timing import Acceleration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from hexmj.measures.physical import PhysicalWalk

DISTANCES = {
    "margin": ("mm", "mean distance between margin of the feet at the ground and planned margin"),
    "drift": ("mm", "mean distance of the centre of mass from O"),
}
"""Distance of a simulated walk from its plan -> unit, long name. Walks count until the plan's loss or the fall."""

FINE = Conditions(longest_substep=0.5)
"""Default conditions: light legs need physics steps of at most 0.5 ms."""

STYLES: dict[str, dict[str, Any]] = MEASURE_STYLES | {"drift": {"color": "0.15", "marker": "o"}}
"""Curve -> its style."""

PANELS = {
    "share of the starts": {"grounded": "grounded", "carried": "carried", "physical": "physical"},
    "agreement with kinematic losses": {
        "agreement_grounded": "grounded",
        "agreement_carried": "carried",
        "agreement": "physical",
    },
    "distance from the planned margin [mm]": {"margin": "grounded"},
    "centre of mass from O [mm]": {"drift": "drift"},
}
"""Label of a panel's axis -> the variables drawn in the panel, and their styles."""


@dataclass(frozen=True)
class StaticLimit(Study):
    """Physical walks from the same starts at every V_p and with every mass of the legs."""

    controller: Controller
    """Controller that plans the walks."""
    velocity: float = 0.5
    """Velocity V_r as a fraction of V_p, 0 <= V < 1; the final velocity when accelerating."""
    vps: Sequence[float] = (400.0, 200.0, 100.0, 50.0, 25.0)
    """Velocities V_p of a swinging foot [mm/s]."""
    leg_masses: Sequence[float] = (1.0, 0.01)
    """Masses of the legs as fractions of the mass of the insect's own legs; the legs of the paper have no mass."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11; without it the velocity is constant."""
    n_starts: int = field(default=200, kw_only=True)
    conditions: Conditions = field(default=FINE, kw_only=True)

    hidden: ClassVar[tuple[str, ...]] = ("vp", "leg_mass")

    @property
    def varies(self) -> Mapping[str, Sequence[float]]:
        """The masses of the legs and the V_p."""
        return {"leg_mass": self.leg_masses, "vp": self.vps}

    def cells(self) -> list[Cell]:
        """Return a cell for each mass of the legs and V_p, computed by `distance_table`."""
        self.check_walks([self.velocity], *self.varied)
        cells = []
        for conditions in self.varied:
            name = f"leg-mass-{conditions.leg_mass:g}-vp-{conditions.vp:g}"
            walks = self.walks(self.velocity, self.observed[1].item(), conditions)
            cells.append(Cell(name, distance_table, {"walks": walks}, conditions.substeps(self.stride)))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return FLSS, agreement between the measures, and distances from the plan.

        Returns:
            Over (leg_mass, vp): the FLSS of `MEASURES` with 95 % Wilson intervals; `agreement`, the fraction of starts
            with a planned loss and a fall, or with neither; `agreement_grounded` and `agreement_carried`, the same for
            these losses instead of the fall. Over (leg_mass, vp, start): the times of the losses and falls, and
            `DISTANCES`.
        """
        mass = {"units": "1", "long_name": "mass of the legs over the insect's own"}
        table = over_axes({"leg_mass": len(self.leg_masses), "vp": len(self.vps)}, data).assign_coords(
            vp=("vp", list(self.vps), {"units": "mm/s", "long_name": "velocity V_p of a swinging foot"}),
            leg_mass=("leg_mass", list(self.leg_masses), mass),
        )
        lost = table.planned_loss < np.inf
        for measure in ("grounded", "carried"):
            same, text = (table[MEASURES[measure]] < np.inf) == lost, f"kinematic and {measure} answer agree"
            table[f"agreement_{measure}"] = same.mean("start").assign_attrs(units="1", long_name=text)
        own = {"velocity": self.velocity, "duration": self.observed[1].item()}
        return self.labelled(with_flss(table), "converge", **own)


def distance_table(walks: WalkSettings, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
    """Compute a cell of the study: the outcomes of `MEASURES` and the `DISTANCES` over start."""
    walk = kept_walk(walks, walks.starts, threads=threads, progress=progress)
    table = over_start({name: getattr(walk.outcomes, name) for name in MEASURES.values()}, UNITS)
    for name, values in distances(walk).items():
        table[name] = ("start", values, dict(zip(("units", "long_name"), DISTANCES[name], strict=True)))
    return table


def distances(walk: "PhysicalWalk") -> dict[str, np.ndarray]:
    """Return the `DISTANCES` of every start, (start,); NaN if the plan is unstable from the first step on.

    With sensory feedback, the distances are measured from the plan that the legs followed.
    """
    plan, seen = walk.ordered, walk.grounded
    compared = plan.time[:, None] < np.minimum(loss_time(plan), walk.outcomes.fall)
    drift = np.linalg.norm(walk.centre_of_mass[..., :2] - walk.qpos[..., :2], axis=-1)
    with np.errstate(invalid="ignore"):
        apart = np.abs(walk_margin(seen) - walk_margin(plan))
        steps = {  # values, and the steps that count, both (step, start); without a foot there is no margin
            "margin": (apart, compared & seen.stance.any(axis=-1)),
            "drift": (drift, compared),
        }
        return {
            name: np.where(counts, values, 0.0).sum(axis=0) / counts.sum(axis=0)
            for name, (values, counts) in steps.items()
        }


def static_limit_figure(result: "xr.Dataset") -> "Figure":
    """Draw FLSS, agreement, margins and drift against V_p, with a line style for each mass of the legs."""
    from matplotlib.lines import Line2D

    figure, result = picture(10.0, 7.4), result.sortby("vp")
    panels, masses, vps = figure.subplots(2, 2, sharex=True).ravel(), result.leg_mass.values, result.vp.values
    lines = ("-", "--", ":", "-.") * len(masses)
    alone, style = (
        result.isel(leg_mass=0, vp=0),
        STYLES["kinematic"] | {"marker": None},
    )  # kinematic FLSS has one value
    panels[0].axhspan(alone.kinematic_low.item(), alone.kinematic_high.item(), alpha=0.15, color=style["color"], lw=0)
    handles = {"kinematic": panels[0].axhline(alone.kinematic.item(), **style)}
    for axes, (title, curves) in zip(panels, PANELS.items(), strict=True):
        shifts = 2.0 ** (0.08 * (np.arange(len(masses) * len(curves)) - (len(masses) * len(curves) - 1) / 2))
        for (curve, mass), shift in zip(product(curves.items(), range(len(masses))), shifts, strict=True):
            (name, look), data = curve, result.isel(leg_mass=mass)
            style = STYLES[look] | {"linestyle": lines[mass]}
            if title == "share of the starts":
                frequency_curve(axes, vps * shift, data, name, **style)
            else:
                values = data[name] if "start" not in data[name].dims else data[name].mean("start")
                (drawn,) = axes.plot(vps, values, markersize=4.5, linewidth=1.6, **style)
                handles.setdefault(look, drawn)
        axes.set(ylabel=title, xscale="log", ylim=(0.0, None) if "[mm]" in title else (-0.02, 1.02))
        axes.set_xticks(vps, [f"{vp:g}" for vp in vps])
        axes.minorticks_off()
        tidy(axes)
    for axes in panels[2:]:
        axes.set_xlabel("$V_p$ [mm/s], logarithmic")
    black = [Line2D([], [], color="0.1", ls=lines[n], label=f"mass of the legs x {m:g}") for n, m in enumerate(masses)]
    named = [drawn for name, drawn in handles.items() if name != "drift"]
    figure.legend(handles=[*named, *black], **LEGEND, loc="outside lower center", ncols=3)
    agreement = result.agreement.isel(leg_mass=0).values
    agree = " and ".join(f"{agreement[i]:.2f} at $V_p$ = {vps[i]:g} mm/s" for i in (0, -1))
    finding, at = f"agreement of falls with planned losses: {agree}", f"V = {result.attrs['velocity']:g}"
    head(figure, finding, at, caption(result), "bars and band: 95 % intervals")
    return figure
