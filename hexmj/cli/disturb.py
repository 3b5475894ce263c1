"""`hexmj disturb`."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import STEADY, Accelerating, ControllerName, hiding
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import difference, interval, table
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.measures.figures import starts_in_words
from hexmj.studies.disturbance import MEASURES, DisturbedWalks, disturbed_figure, strategies_in_words
from hexmj.studies.disturbed_walks import PHYSICAL, Answer, Kind

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

NEEDS = {"impulses": "push", "adhesion": "grasp", "recovery": "slow_down", "initial_velocity": "slow_down"}
"""Option -> the disturbance or strategy that it belongs to."""


@dataclass(frozen=True)
class Disturb(StudyCommand):
    """Options of `hexmj disturb`, which `commands.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    velocities: Sequence[float] = DisturbedWalks.velocities
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    disturbances: Sequence[Kind] | None = None
    """The body is halted, or one protracting leg is stopped, or the body is pushed from the side; all unless given."""
    impulses: Sequence[float] = DisturbedWalks.impulses
    """Impulses of the pushes, in multiples of the insect's mass times V_p."""
    strategies: Sequence[Answer] | None = None
    """Legs go to the nearest posture of undisturbed walking, or the walk begins again from --initial-velocity, or feet
    hold on to the ground; all, beside none, unless given, and none alone where the option has no values."""
    recovery: float = DisturbedWalks.recovery
    """Acceleration a of Eq. 11 after slowing down [1 / time unit]; the paper's is 0.00008."""
    initial_velocity: float = DisturbedWalks.initial_velocity
    """V_r(0) to which a walk slows down, a fraction of V_p."""
    adhesion: float = DisturbedWalks.adhesion
    """Adhesion of a foot that the plan lets stand where the strategy is to grasp, in multiples of the insect's
    weight."""
    starts: int = DisturbedWalks.n_starts
    """Number of random starts that walk stably until they are disturbed, the same in every case."""
    kinematic: bool = False
    """Leave physics out, and with it pushes and grasping."""
    out: Path = Path("results/disturb")
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    conditions: OmitArgPrefixes[Conditions] = hiding(Conditions(), ["grasp"])
    outputs = Outputs("disturbing walks", "disturb.nc", {"disturb.png": disturbed_figure})

    def study(self) -> DisturbedWalks:
        if self.kinematic:
            self.refuse_physical("with --kinematic")
        controller = self.controlled.controller(self.model)
        self.refuse_contact_gap(controller)
        left_out = PHYSICAL if self.kinematic else ()

        def chosen(given: Sequence[Any] | None, every: Sequence[Any]) -> Sequence[Any]:
            return [one for one in every if one not in left_out] if given is None else given

        study = DisturbedWalks(
            controller,
            self.velocities,
            chosen(self.disturbances, DisturbedWalks.disturbances),
            self.impulses,
            chosen(self.strategies, DisturbedWalks.strategies),
            self.recovery,
            self.initial_velocity,
            self.adhesion,
            self.kinematic,
            n_starts=self.starts,
            observation_time=self.walks.time,
            **self.steady,
        )
        met, usual = {*study.disturbances, *study.strategies}, Disturb()
        for name, needed in NEEDS.items():
            if getattr(self, name) != getattr(usual, name) and needed not in met:
                raise InputError(f"--{name.replace('_', '-')} without {needed}; expected it among those that are tried")
        return study

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """Tables for every measure, how the starts were found, the strategies, and the conditions."""
        for measure in MEASURES:
            if measure in result:
                yield from _tables(result, measure)
        found = (f"{n} at V = {v:g}" for n, v in zip(result.drawn.values, result.velocity.values, strict=True))
        starts = f"{starts_in_words(self.starts)} whose plan is stable until it is disturbed"
        if {*result.strategy.values} - {"none"}:
            yield "takes off: how much lower than without a strategy, on the same starts"
        yield f"{self.controlled.controller(self.model).name}; {starts}, the first of {', '.join(found)}"
        if told := strategies_in_words(result):
            yield told
        walked = (result.velocity * (result.back + result.duration)).max()
        yield self.conditions_line(physical=not self.kinematic, walked=float(walked))


def _tables(result: "xr.Dataset", measure: str) -> "list[str | Table]":
    """FLSS by one measure and what the strategies take off it, each under its heading."""
    strategy, kinds = result.strategy.values, [one.partition(" ")[0] for one in result.disturbance.values]
    on_paper = [not {kind, one} & {*PHYSICAL} for kind, one in zip(kinds, strategy, strict=True)]
    shown = [n for n, one in enumerate(on_paper) if one or measure == "physical"]
    answered, slow = [n for n in shown if strategy[n] != "none"], [n for n in shown if strategy[n] == "slow_down"]
    least = result[f"{measure}_reached"].min().item()
    parts: list[str | Table] = [
        f"{measure} FLSS from the disturbance on, at least {starts_in_words(least)}, with 95 % intervals"
        + (", to the end of the observation time, which begins at full velocity again" if slow else ""),
        _table(result.sel(observation_time="whole").isel(case=shown), measure, interval),
    ]
    if slow:
        short = _table(result.sel(observation_time="short").isel(case=slow), measure, interval)
        parts += ["The same if the observation time begins with the disturbance", short]
    if answered:
        buys = _table(result.sel(observation_time="whole").isel(case=answered), f"{measure}_buys", difference)
        parts += [f"What a strategy takes off the {measure} FLSS", buys]
    return parts


def _table(result: "xr.Dataset", name: str, told: "Callable[[xr.Dataset, str], str]") -> "Table":
    """A row for each case, a column for each velocity, in which a number is told with its ends."""
    rows = []
    for case in range(result.sizes["case"]):
        row = result.isel(case=case)
        cells = (told(row.sel(velocity=v), name) for v in result.velocity.values)
        rows.append((row.disturbance.item(), row.strategy.item().replace("_", " "), *cells))
    return table(("disturbance", "strategy", *(f"V = {v:g}" for v in result.velocity.values)), rows)
