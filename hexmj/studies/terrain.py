"""Terrain: the frequency of falls in physical walks that have reached a step, gap, hurdle or rough ground.

The same starts walk on flat ground and towards every obstacle; the walks are identical until a foot reaches the
obstacle. The commanded distance takes the hindmost foot a step length beyond the longest obstacle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.measures.figures import caption
from hexmj.measures.study import Study, outcome_table
from hexmj.measures.tables import VELOCITY, frequency, reach
from hexmj.plotting import LEGEND, SERIES, frequency_curve, head, picture, tidy
from hexmj.sweep import Cell, over_axes
from hexmj.timing import steps_within
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

ObstacleKind = Literal["step", "gap", "hurdle", "rough"]
"""Kind of ground other than 'flat', see `Conditions.ground`."""

OUTCOMES = {
    "fall": "first contact of the trunk with the ground, or inf",
    "fall_part": "index of the part that touched first, -1 for none",
    "tilt": "greatest tilt of the trunk",
    "speed": "distance walked ahead over distance commanded, until the fall",
}
"""Field of `physics.outcomes.Outcomes` that the result contains -> its long name."""

FARTHER = Conditions(ground_at=80.0)
"""Default conditions: obstacles begin at 80 mm, so that walks reach their steady-state gait before an obstacle."""

SIZES = {
    "step": "height of the step [mm]",
    "gap": "length of the gap [mm]",
    "hurdle": "height of the hurdle [mm]",
    "rough": "highest bump [mm]",
}
"""Kind of ground -> axis label of its size."""


@dataclass(frozen=True)
class Terrain(Study):
    """Physical walks from the same starts on flat ground and towards every obstacle, per adhesion and velocity."""

    controller: Controller
    """Controller that plans the walks."""
    velocities: Sequence[float] = (0.2, 0.4, 0.6)
    """Velocities V_r as fractions of V_p, 0 < V < 1; the commanded distance is the same at every velocity."""
    grounds: Sequence[ObstacleKind] = ("step", "gap", "hurdle", "rough")
    """Kinds of obstacles; flat ground is always walked too."""
    heights: Sequence[float] = (2.0, 4.0, 6.0)
    """Heights of steps, hurdles and the highest bumps of rough ground [mm]."""
    lengths: Sequence[float] = (2.5, 5.0, 10.0)
    """Lengths of gaps [mm]."""
    grasps: Sequence[float] = (0.0, 1.0)
    """Adhesion of a standing foot, in multiples of the insect's weight; 0 is no adhesion."""
    n_starts: int = field(default=30, kw_only=True)
    conditions: Conditions = field(default=FARTHER, kw_only=True)

    hidden: ClassVar[tuple[str, ...]] = ("ground", "ground_height", "grasp")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.observed[0] > 0).all():
            raise InputError(f"velocities = {self.velocities}; expected 0 < V < 1, so that obstacles are reached")
        for name in ("grounds", "heights", "lengths", "grasps"):
            distinct(name, getattr(self, name))
        for grasp in self.grasps:
            replace(self.conditions, grasp=grasp)
        _ = self.obstacles

    @property
    def obstacles(self) -> dict[str, Conditions]:
        """The conditions of flat ground, 'flat', and of each obstacle, by names such as 'step 2 mm'."""
        named = {"flat": self.conditions}
        for ground in self.grounds:
            name, sizes = ("ground_length", self.lengths) if ground == "gap" else ("ground_height", self.heights)
            for size in sizes:
                obstacle = f"{ground} {float(size)}".removesuffix(".0")
                named[f"{obstacle} mm"] = replace(self.conditions, ground=ground, **{name: size})
        return named

    @property
    def distance(self) -> float:
        """The commanded distance of all walks [mm]."""
        _, behind = reach(self.stride)
        return max(map(_end, self.obstacles.values())) + behind + self.stride.aep0 - self.stride.pep0

    def cells(self) -> list[Cell]:
        """Return a cell for each obstacle, adhesion and velocity, computed by `outcome_table`."""
        self.check_walks(self.velocities, *(replace(self.conditions, grasp=grasp) for grasp in self.grasps))
        cells = []
        for (obstacle, conditions), grasp, v in product(self.obstacles.items(), self.grasps, self.observed[0]):
            walks = self.walks(v, self.distance / v, replace(conditions, grasp=grasp))
            cells.append(Cell(f"{obstacle}-grasp-{grasp:g}-V-{v:g}", outcome_table, {"walks": walks}, walks.work))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the falls after the obstacle was reached, and the starts that crossed the obstacle.

        Returns:
            Over (obstacle, grasp, velocity), the obstacle 'flat' first: `reached`, the number of starts that do not
            fall before a front foot can reach the obstacle; `flss`, the fraction of these that fall later, with its
            95 % Wilson interval `flss_low`, `flss_high`; and `crossed`, the number of starts without a fall whose hind
            feet get beyond the obstacle. Over (obstacle, grasp, velocity, start): `OUTCOMES`, the `distance` walked
            [mm], and `after`, whether the start falls after it has reached the obstacle.
        """
        before = self.obstacles.values()
        sizes = {"obstacle": len(before), "grasp": len(self.grasps), "velocity": len(self.velocities)}
        end = [_end(conditions) for conditions in before]
        grasp = {"units": "1", "long_name": "adhesion of a foot over the insect's weight"}
        table = over_axes(sizes, [cell[list(OUTCOMES)] for cell in data]).assign_coords(
            obstacle=list(self.obstacles),
            ground=("obstacle", [conditions.ground for conditions in before]),
            size=("obstacle", [_size(conditions) for conditions in before], {"units": "mm"}),
            end=("obstacle", end, {"units": "mm", "long_name": "where the obstacle ends or has been climbed"}),
            grasp=("grasp", list(self.grasps), grasp),
            velocity=("velocity", self.observed[0], VELOCITY),
        )
        for name, text in OUTCOMES.items():
            table[name].attrs["long_name"] = text
        time = steps_within(self.distance / table.velocity.values, self.stride) * self.stride.dt
        commanded = np.minimum(table.fall, table.velocity.copy(data=time)) * table.velocity
        walked = (table.speed * commanded).assign_attrs(units="mm", long_name="distance walked by O")
        ahead, behind = reach(self.stride)
        upright, reaching = np.isinf(table.fall), commanded > self.conditions.ground_at - ahead
        after = reaching & ~upright
        reached = reaching.sum("start")
        crossed = (upright & (walked > table.end + behind)).sum("start")
        table = table.assign(
            distance=walked,
            after=after.assign_attrs(units="1", long_name="fell after it had reached the obstacle"),
            reached=reached.assign_attrs(units="1", long_name="starts that reached the obstacle"),
            crossed=crossed.assign_attrs(units="1", long_name="starts that crossed it without a fall"),
            **frequency("flss", after.where(reaching).transpose(*sizes, "start").values, tuple(sizes)),
        )
        table.flss.attrs["long_name"] = "FLSS from there on"
        return self.labelled(table, "terrain", observation_time=f"{self.distance:g} / V", distance=self.distance)


def _end(conditions: Conditions) -> float:
    """Return how far ahead of O at time 0 an obstacle ends [mm]; steps and rough ground end where they begin."""
    return conditions.ground_at + (conditions.ground_length if conditions.ground in ("gap", "hurdle") else 0.0)


def _size(conditions: Conditions) -> float:
    """Return the length of a gap or the height of another obstacle [mm]; 0 for flat ground."""
    return {"flat": 0.0, "gap": conditions.ground_length}.get(conditions.ground, conditions.ground_height)


def terrain_figure(result: "xr.Dataset") -> "Figure":
    """Draw falls against obstacle size: a column for each kind of ground, a row for each adhesion, flat ground at 0."""
    ground, grasps, speeds = result.ground.values, result.grasp.values, result.velocity.values
    kinds = list(dict.fromkeys(ground[ground != "flat"]))
    figure = picture(max(6.0, 1.0 + 2.8 * len(kinds)), 1.4 + 2.4 * len(grasps))
    panels = figure.subplots(len(grasps), len(kinds), sharey=True, sharex="col", squeeze=False)
    for (row, column), axes in np.ndenumerate(panels):
        chosen = np.flatnonzero(np.isin(ground, ("flat", kinds[column])))
        data = result.sel(grasp=grasps[row]).isel(obstacle=chosen).sortby("size")
        sizes = data["size"].values
        shifts = (np.arange(len(speeds)) - (len(speeds) - 1) / 2) * 0.03 * sizes.max()
        for v, style, shift in zip(speeds, SERIES * len(speeds), shifts, strict=False):
            frequency_curve(axes, sizes + shift, data.sel(velocity=v), "flss", label=f"V = {v:g}", **style)
        axes.set(
            ylim=(-0.02, 1.02), xlabel=SIZES[kinds[column]], ylabel=f"frequency of falls\nadhesion {grasps[row]:g}"
        )
        axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axes.label_outer()
        tidy(axes)
    handles, _ = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles=handles, **LEGEND, loc="outside lower center", ncols=len(handles))
    falls = result.flss.mean(["grasp", "velocity"]).dropna("obstacle")
    ends = {"fewest": falls.values.argmin(), "most": falls.values.argmax()}
    finding = "; ".join(f"{word} falls: {falls.obstacle.values[n]} ({falls.values[n]:.2f})" for word, n in ends.items())
    shown = "falls after the obstacle is reached, mean over the curves; size 0: flat ground; bars: 95 % intervals"
    head(figure, finding, caption(result, int(result.reached.min())), shown)
    return figure
