"""Disturbed walks, kinematic and physical: the effect of a halt, a stopped leg or a push, and of three strategies.

At every velocity, all strategies face the same disturbances of the same starts at the same times. These starts are the
seed's first starts whose plan keeps static stability until the disturbance.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.io import settings
from hexmj.measures.figures import caption
from hexmj.measures.study import Study
from hexmj.measures.tables import differences, frequency, velocity_axis
from hexmj.plotting import LEGEND, SERIES, flss_axes, frequency_curve, head, picture
from hexmj.studies.disturbed_walks import GRID, NO_DISTURBANCE, Answer, Case, Kind, StableWalks, Strategy
from hexmj.sweep import Cell, over_axes
from hexmj.timing import Acceleration, check_reached, steps_within
from hexmj.validate import choice, distinct

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MEASURES = {"kinematic": "planned_loss", "physical": "fall"}
"""Measure of FLSS -> outcome, the time of the event that the measure counts."""
STYLES: dict[str, dict[str, Any]] = dict(zip(("none", "reorganise", "slow_down", "grasp"), SERIES, strict=False))
"""Strategy -> style of its curve."""

PHYSICAL = ("push", "grasp")
"""Disturbances and strategies that act on the simulated body and leave the plan unchanged."""

MOST_IMPULSE = 80.0
"""Maximum impulse of a push, in multiples of m V_p; a larger impulse throws the insect into the air."""

ABOUT = "no strategy", "reorganise: next stable posture", "slow down: for a while", "grasp: feet adhere"
LABELS = dict(zip(STYLES, ABOUT, strict=True))
"""Strategy -> label of its curve."""

UNDISTURBED: dict[str, Any] = {"color": "0.15", "linestyle": ":", "marker": "x", "label": "no disturbance"}
ROWS = {"kinematic": "kinematic FLSS", "physical": "frequency of falls"}
"""Measure -> label of its row of panels."""


@dataclass(frozen=True)
class DisturbedWalks(Study):
    """Walks from the same starts, undisturbed and with every disturbance and strategy, at every velocity."""

    controller: Controller
    """Controller whose plans can be steered (see `SteerableController`), with or without sensory feedback."""
    velocities: Sequence[float] = (0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    disturbances: Sequence[Kind] = ("halt", "leg", "push")
    """Disturbances: the body is halted, one swinging leg is stopped, or the body is pushed from the side."""
    impulses: Sequence[float] = (40.0, 60.0)
    """Impulses of the pushes, in multiples of the insect's mass times V_p."""
    strategies: Sequence[Answer] = ("reorganise", "slow_down", "grasp")
    """Strategies beside none: legs go to the nearest posture of undisturbed walking; the walk slows down to the initial
    velocity and accelerates again; feet adhere to the ground."""
    recovery: float = 0.002
    """Acceleration a of Eq. 11 after slowing down [1 / time unit]; the paper uses 0.00008."""
    initial_velocity: float = Acceleration.start
    """Velocity V_r(0) to which the strategy 'slow_down' reduces V_r, as a fraction of V_p."""
    adhesion: float = 1.0
    """Adhesion of a standing foot with the strategy 'grasp', in multiples of the insect's weight."""
    kinematic: bool = False
    """Compute kinematic walks only, without pushes and the strategy 'grasp', which need the simulated body."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    n_starts: int = field(default=40, kw_only=True)
    """Number of random starts whose plan is stable until the disturbance, the same for every case at a velocity."""

    hidden: ClassVar[tuple[str, ...]] = ("grasp",)

    def __post_init__(self) -> None:
        super().__post_init__()
        (v, time), slows = self.observed, "slow_down" in self.strategies
        low = self.initial_velocity if slows else 0.0
        if not ((v > 0) & (v >= low)).all():
            raise InputError(f"velocities = {v.tolist()}; expected above 0 and at least {low:g}, the initial velocity")
        if slows:
            check_reached(v, self.stride, self.back)
            steps_within(time + self.back.duration(v), self.stride)
        if not self.kinematic and "push" in self.disturbances:
            from hexmj.physics.pushes import can_push

            if not can_push(self.conditions, self.stride, time.min()):
                raise InputError(f"observation_time = {self.observation_time!r}; expected longer than a push lasts")
        for name, valid in {"disturbances": get_args(Kind), "strategies": get_args(Answer)}.items():
            values = [choice(name, value, valid) for value in getattr(self, name)]
            distinct(name, ["none", *values])
        if not all(0 < impulse <= MOST_IMPULSE for impulse in self.impulses):
            raise InputError(f"impulses = {self.impulses}; expected above 0 and at most {MOST_IMPULSE:g} (in m V_p)")
        distinct("disturbances", [case for case in self.cases if case.disturbance != NO_DISTURBANCE])
        _ = self.grasping, [self._walks(velocity) for velocity in v]

    @property
    def grasping(self) -> Conditions:
        """The conditions of walks with the strategy 'grasp': feet adhere with `adhesion`."""
        return replace(self.conditions, grasp=self.adhesion)

    @property
    def back(self) -> Acceleration:
        """The acceleration with which the strategy 'slow_down' returns to V_r."""
        return Acceleration(self.recovery, self.initial_velocity)

    @property
    def cases(self) -> list[Case]:
        """The undisturbed case, then the cases of each disturbance: without a strategy, and with each strategy.

        If `kinematic`, there are no pushes and no strategy 'grasp'.
        """
        left_out = PHYSICAL if self.kinematic else ()
        kinds: list[Kind] = [kind for kind in self.disturbances if kind not in left_out]
        answers: list[Strategy] = ["none", *(answer for answer in self.strategies if answer not in left_out)]
        return [Case("push", "none")] + [
            Case(kind, answer, float(impulse))
            for kind in kinds
            for impulse in (self.impulses if kind == "push" else (0.0,))
            for answer in answers
        ]

    def cells(self) -> list[Cell]:
        """Return a cell for each velocity and case, computed by `StableWalks.times`."""
        grasps = not self.kinematic and "grasp" in self.strategies
        self.check_walks(self.velocities, *([self.grasping] if grasps else []))
        cells = []
        for velocity, time in zip(*self.observed, strict=True):
            walks = self._walks(velocity)
            for case in self.cases:
                conditions = self.grasping if case.strategy == "grasp" else self.conditions
                settings = {
                    "case": case,
                    "observation_time": time,
                    "recovery": self.back if case.strategy == "slow_down" else None,
                    "conditions": None if self.kinematic else conditions,
                }
                name = f"{case.disturbance}-{case.strategy}-V-{velocity:g}"
                cells.append(Cell(name, walks.times, settings, work=time))
        return cells

    def _walks(self, velocity: float) -> StableWalks:
        return StableWalks(self.controller, velocity, self.n_starts, self.seed, self.stride)

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the times of losses and falls, and their frequencies after the disturbance.

        Returns:
            Over (velocity, case, start): the `disturbed_walks.TIMES`. Over case: `disturbance` and `strategy`; the
            first case is undisturbed. Over velocity: the observation time `duration` [time units] and `drawn`, the
            number of random starts drawn to find the stable starts. In addition the frequencies of `with_flss_after`.
        """
        table = over_axes({"velocity": len(self.velocities), "case": len(self.cases)}, data).assign_coords(
            **velocity_axis(*self.observed),
            disturbance=("case", [case.disturbance for case in self.cases]),
            strategy=("case", [case.strategy for case in self.cases]),
        )
        drawn = table.drawn.isel(case=0).assign_attrs(units="1", long_name="starts drawn to find these")
        own = {"recovery": asdict(self.back), "adhesion": self.adhesion, "physical": not self.kinematic}
        return self.labelled(with_flss_after(table.assign(drawn=drawn)), "disturb", grid=GRID, **own)


def with_flss_after(data: "xr.Dataset") -> "xr.Dataset":
    """Add frequencies over (observation_time, velocity, case) to the times of losses and falls.

    Both observation times begin with the disturbance: `whole` ends when the walk has been back at its velocity for
    `duration`, and `short` ends `duration` after the disturbance.
    `kinematic_reached` is the number of starts that are statically stable until the disturbance. `kinematic` is the
    fraction of these that lose static stability within the observation time, with its 95 % Wilson interval.
    `kinematic_buys` is `kinematic` of the same disturbance without a strategy minus `kinematic`, over the starts that
    reach the disturbance in both cases, with its 95 % interval. Variables of `physical` count falls in the same way.
    """
    dims = ("observation_time", "velocity", "case")
    names = data.disturbance.values.tolist()
    without = [names.index(name) for name in names]  # the first case of a disturbance has no strategy
    new: dict[str, Any] = {"observation_time": ["whole", "short"]}
    time, back, duration = data.time.values, data.back.values, data.duration.values[:, None, None]
    ends, close = np.stack((back + duration, time + duration)), 1e-6  # times that differ by less are equal
    for measure in [name for name in MEASURES if MEASURES[name] in data]:
        when = data[MEASURES[measure]].values
        reached = when > time + close
        lost = np.where(reached, when <= ends + close, np.nan)
        new |= frequency(measure, lost, dims) | differences(f"{measure}_buys", lost[:, :, without], lost, dims)
        new[f"{measure}_reached"] = (dims[1:], reached.sum(axis=-1), {"units": "1"})
    return data.assign(new)


def strategies_in_words(result: "xr.Dataset") -> str:
    """Return a text with the parameters of the strategies 'slow_down' and 'grasp' in a result, if it has them."""
    recorded, words = settings(result), []
    if "slow_down" in result.strategy.values and "recovery" in recorded:
        words.append("slow down to V = {start:g}, then a = {rate:g}".format(**recorded["recovery"]))
    if "grasp" in result.strategy.values and "adhesion" in recorded:
        words.append(f"grasp {recorded['adhesion']:g}")
    return "; ".join(words)


def disturbed_figure(result: "xr.Dataset") -> "Figure":
    """Draw FLSS after the disturbance, within `whole`: a column for each disturbance and a row for each measure."""
    names, strategies = result.disturbance.values, result.strategy.values
    kinds, measures = list(dict.fromkeys(names[names != NO_DISTURBANCE])), [name for name in ROWS if name in result]
    figure = picture(max(7.0, 1.0 + 2.3 * len(kinds)), 1.3 + 2.2 * len(measures))
    panels = figure.subplots(len(measures), len(kinds), sharex=True, sharey=True, squeeze=False)
    data = result.sel(observation_time="whole").sortby("velocity").transpose("velocity", "case", ...)
    v, empty, shifts = data.velocity.values, [], dict(zip(STYLES, np.linspace(-0.02, 0.02, len(STYLES)), strict=True))
    for (row, column), axes in np.ndenumerate(panels):
        measure, kind = measures[row], kinds[column]
        if measure == "kinematic" and kind.startswith("push"):
            axes.axis("off")  # a push does not change the plan
            empty.append(axes)
            continue
        if row == 0 or panels[row - 1, column] in empty:
            axes.set_title(_title(kind), fontsize=11)
        for case in np.flatnonzero(names == NO_DISTURBANCE):
            axes.plot(v, data[measure].isel(case=case), **UNDISTURBED, zorder=5)
        for case in np.flatnonzero((names == kind) & ((strategies != "grasp") | (measure == "physical"))):
            style = STYLES[strategies[case]] | {"label": LABELS[strategies[case]]}
            frequency_curve(axes, v + shifts[strategies[case]], data.isel(case=case), measure, **style)
        flss_axes(axes, v, ROWS[measure])
        axes.label_outer()
        axes.tick_params(labelleft=column == 0)
    least = min(int(data[f"{measure}_reached"].min()) for measure in measures)
    handles, _ = panels[-1, -1].get_legend_handles_labels()
    if empty:
        note = {"title": "A push does not change the plan\nor its kinematic FLSS.\n", "title_fontsize": 9}
        place: Any = {"loc": "center", "bbox_to_anchor": (len(empty) / 2, 0.5)}
        empty[0].legend(handles=handles, **LEGEND, **note, **place).set_in_layout(False)
    else:
        figure.legend(handles=handles, **LEGEND, loc="outside lower center", ncols=3)
    means = {name: data[measures[-1]][:, (strategies == name) & (names != NO_DISTURBANCE)].mean() for name in LABELS}
    words = ", ".join(f"{LABELS[name].split(':')[0]} {mean:.2f}" for name, mean in means.items() if mean.notnull())
    shown = caption(result, least), strategies_in_words(result), "bars: 95 % intervals"
    head(figure, f"mean {ROWS[measures[-1]]}: {words}", *shown)
    return figure


def _title(disturbance: str) -> str:
    kind, _, impulse = disturbance.partition(" ")
    return {"halt": "body halted", "leg": "one leg stopped"}.get(kind, f"push of {impulse} $m V_p$")
