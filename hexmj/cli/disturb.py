"""`hexmj disturb`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Controlled, ControllerName, Hidden, Sweepers, Walks, refuse_physical
from hexmj.cli.sweep import lists_of, run_study
from hexmj.cli.tables import conditions_line, interval, new_table, print_json, show
from hexmj.conditions import Conditions, FootContact
from hexmj.errors import InputError
from hexmj.studies.disturbance.cases import PHYSICAL, Answer, Kind
from hexmj.studies.disturbance.study import RECOVERY, DisturbedWalks
from hexmj.timing import Acceleration

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


@dataclass(frozen=True)
class _Contact(FootContact):
    grasp: Hidden = FootContact.grasp


@dataclass(frozen=True)
class _Conditions(Conditions):
    """All but the strategy's own."""

    contact: OmitArgPrefixes[_Contact] = field(default_factory=_Contact)


@dataclass(frozen=True)
class Disturb:
    """Walks that a halt, a stopped leg or a push disturbs, on paper and in physics, and what three strategies buy.

    Repeat the command to go on with a run that was stopped.
    """

    model: ControllerName = "ldvs"
    velocities: Sequence[float] = DisturbedWalks.velocities
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    disturbances: Sequence[Kind] = ()
    """The body is halted, or one protracting leg is stopped, or the body is pushed from the side; all unless given."""
    impulses: Sequence[float] = DisturbedWalks.impulses
    """Impulses of the pushes, in multiples of the insect's mass times V_p."""
    strategies: Sequence[Answer] = ()
    """Legs go to the nearest posture of undisturbed walking, or the walk begins again from --initial-velocity, or feet
    hold on to the ground; all, beside none, unless given."""
    recovery: float = RECOVERY.rate
    """Acceleration a of Eq. 11 after slowing down [1 / time unit]; the paper's is 0.00008."""
    initial_velocity: float = RECOVERY.start
    """V_r(0) to which a walk slows down, a fraction of V_p."""
    adhesion: float = DisturbedWalks.adhesion
    """Adhesion of a foot that the plan lets stand where the strategy is to grasp, in multiples of the insect's
    weight."""
    starts: int = DisturbedWalks.n_starts
    """Number of random starts that walk stably until they are disturbed, the same in every case."""
    kinematic: bool = False
    """Leave physics out, and with it pushes and grasping."""
    out: Path = Path("results/disturb")
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    conditions: OmitArgPrefixes[_Conditions] = field(default_factory=_Conditions)

    def _check(self, study: DisturbedWalks) -> None:
        """Refuse options that would not be obeyed."""
        needs = {"impulses": "push", "adhesion": "grasp", "recovery": "slow_down", "initial_velocity": "slow_down"}
        met, usual = {*study.disturbances, *study.strategies}, Disturb()
        for name, needed in needs.items():
            if getattr(self, name) != getattr(usual, name) and needed not in met:
                raise InputError(f"--{name.replace('_', '-')} without {needed}; expected it among those that are tried")

    def run(self) -> None:
        """Disturb walks, write the results, and print."""
        from hexmj.studies.disturbance.figure import disturbed_figure
        from hexmj.studies.disturbance.frequencies import MEASURES

        if self.kinematic:
            refuse_physical(Conditions.of(**self.conditions.flat()), self.controlled, "with --kinematic")
        left_out = PHYSICAL if self.kinematic else ()
        study = DisturbedWalks(
            self.controlled.controller(self.model),
            self.velocities,
            self.disturbances or [one for one in DisturbedWalks.disturbances if one not in left_out],
            self.impulses,
            self.strategies or [one for one in DisturbedWalks.strategies if one not in left_out],
            Acceleration(self.recovery, self.initial_velocity),
            self.adhesion,
            not self.kinematic,
            self.starts,
            self.walks.time,
            self.walks.seed,
            Conditions.of(**self.conditions.flat()),
            self.walks.stride,
        )
        self._check(study)
        figures = {"disturb.png": disturbed_figure}
        result, files = run_study(
            study, "disturbing walks", self.out, self.sweepers, data="disturb.nc", figures=figures
        )
        if self.json:
            print_json(lists_of(result.drop_dims("start")) | {"settings": result.attrs, "files": files})
            return
        found = ", ".join(f"{n} at V = {v:g}" for n, v in zip(result.drawn.values, result.velocity.values, strict=True))
        conditions = None if self.kinematic else self.conditions
        show(
            *(part for measure in MEASURES if measure in result for part in _tables(result, measure)),
            "takes off: how much lower than without a strategy, on the same starts",
            f"{study.controller.name}; {self.starts} starts whose plan is stable until it is disturbed, the first of"
            f" {found}",
            f"slow down to V = {self.initial_velocity:g}, then a = {self.recovery:g}; grasp {self.adhesion:g}",
            conditions_line(self.walks, self.controlled, None, conditions),
            *map(str, files),
        )


def _tables(result: "xr.Dataset", measure: str) -> "list[str | Table]":
    """FLSS by one measure and what the strategies take off it, each under its heading."""
    strategy = result.strategy.values
    shown = [n for n, one in enumerate(strategy) if measure == "physical" or one != "grasp"]
    answered, slow = [n for n in shown if strategy[n] != "none"], [n for n in shown if strategy[n] == "slow_down"]
    least = result[f"{measure}_reached"].min().item()
    parts: list[str | Table] = [
        f"{measure} FLSS from the disturbance on, at least {least} starts, with 95 % intervals"
        + (", to the end of the window, which begins at full velocity again" if slow else ""),
        _table(result.sel(window="whole").isel(case=shown), measure),
    ]
    if slow:
        short = _table(result.sel(window="short").isel(case=slow), measure)
        parts += ["The same if the window begins with the disturbance", short]
    if answered:
        buys = _table(result.sel(window="whole").isel(case=answered), f"{measure}_buys")
        parts += [f"What a strategy takes off the {measure} FLSS", buys]
    return parts


def _table(result: "xr.Dataset", name: str) -> "Table":
    """A row for each case, a column for each velocity."""
    table = new_table("disturbance", "strategy", *(f"V = {v:g}" for v in result.velocity.values))
    for case in range(result.sizes["case"]):
        row = result.isel(case=case)
        cells = (interval(row.sel(velocity=v), name) for v in result.velocity.values)
        table.add_row(row.disturbance.item(), row.strategy.item().replace("_", " "), *cells)
    return table
