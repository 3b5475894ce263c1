"""`hexmj terrain`."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Fixed, OmitArgPrefixes, Suppress

from hexmj.cli.options import Controlled, ControllerName, Hidden, Sweepers, Walks
from hexmj.cli.sweep import run_study
from hexmj.cli.tables import conditions_line, interval, new_table, print_json, show
from hexmj.conditions import Conditions, FootContact, Ground, GroundKind
from hexmj.studies.terrain import study as terrain
from hexmj.studies.terrain.study import FARTHER, VARIED, ObstacleKind

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

TABLED = ("flss", "flss_low", "flss_high", "reached", "crossed")
"""What is printed as JSON of every obstacle, grasp and velocity."""


@dataclass(frozen=True)
class _Walks(Walks):
    """Each start walks a distance instead of a time."""

    window: Annotated[str, Fixed, Suppress] = Walks.window


@dataclass(frozen=True)
class _Contact(FootContact):
    grasp: Hidden = FootContact.grasp


@dataclass(frozen=True)
class _Ground(Ground):
    ground: Annotated[GroundKind, Fixed, Suppress] = Ground.ground
    ground_height: Hidden = Ground.ground_height
    ground_at: float = FARTHER.ground.ground_at
    """Where obstacles begin, ahead of O at the start [mm]."""
    ground_length: float = Ground.ground_length
    """Length of hurdles along the way [mm]."""


@dataclass(frozen=True)
class _Conditions(Conditions):
    """All but those that are given as lists."""

    contact: OmitArgPrefixes[_Contact] = field(default_factory=_Contact)
    ground: OmitArgPrefixes[_Ground] = field(default_factory=_Ground)


@dataclass(frozen=True)
class Terrain:
    """Steps, gaps, hurdles and rough ground in physics: how often the insect falls once it has reached one.

    Repeat the command to go on with a run that was stopped.
    """

    model: ControllerName = "ldvs"
    velocities: Sequence[float] = terrain.Terrain.velocities
    """Velocities V_r as fractions of V_p, 0 < V < 1; all starts are told to walk the same distance."""
    grounds: Sequence[ObstacleKind] = terrain.Terrain.grounds
    """Kinds of obstacles, beside flat ground."""
    heights: Sequence[float] = terrain.Terrain.heights
    """Heights of steps, hurdles and rough ground [mm]."""
    lengths: Sequence[float] = terrain.Terrain.lengths
    """Lengths of gaps [mm]."""
    grasps: Sequence[float] = terrain.Terrain.grasps
    """Adhesion of a foot that the plan lets stand, in multiples of the insect's weight."""
    starts: int = terrain.Terrain.n_starts
    """Number of random starts, the same for every obstacle."""
    out: Path = Path("results/terrain")
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[_Walks] = field(default_factory=_Walks)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    conditions: OmitArgPrefixes[_Conditions] = field(default_factory=_Conditions)

    def run(self) -> None:
        """Walk to the obstacles, write the results, and print."""
        from hexmj.studies.terrain.figure import terrain_figure

        study = terrain.Terrain(
            self.controlled.controller(self.model),
            self.velocities,
            self.grounds,
            self.heights,
            self.lengths,
            self.grasps,
            self.starts,
            self.walks.seed,
            Conditions.of(**self.conditions.flat()),
            self.walks.stride,
        )
        figures = {"terrain.png": terrain_figure}
        result, files = run_study(
            study, "walking to obstacles", self.out, self.sweepers, data="terrain.nc", figures=figures
        )
        if self.json:
            lists = {str(name): result[name].values.tolist() for name in (*result.coords, *TABLED)}
            print_json(lists | {"settings": result.attrs, "files": files})
            return
        walks = replace(self.walks, window=f"{result.attrs['distance']:g} / V")
        show(
            f"{study.controller.name}, {self.starts} starts: FLSS once the obstacle has been reached, with 95 %"
            " intervals",
            _table(result, self.conditions.body.trunk),
            conditions_line(walks, self.controlled, None, self.conditions, varied=tuple(VARIED)),
            *map(str, files),
        )


def _table(result: "xr.Dataset", trunk: tuple[str, ...]) -> "Table":
    """A row for each obstacle and grasp, a column for each velocity."""
    velocities = result.velocity.values
    table = new_table("obstacle", "grasp", *(f"V = {v:g}" for v in velocities), "crossed", "fell on")
    for name in result.obstacle.values:
        for grasp in result.grasp.values:
            one = result.sel(obstacle=name, grasp=grasp)
            frequencies = (interval(one.sel(velocity=v), "flss") for v in velocities)
            crossed = f"{one.crossed.sum().item()} of {one.reached.sum().item()}"
            table.add_row(name, f"{grasp:g}", *frequencies, crossed, _parts(one, trunk))
    return table


def _parts(one: "xr.Dataset", trunk: tuple[str, ...]) -> str:
    """Parts of the trunk that touched the ground first after an obstacle had been reached, most frequent first."""
    parts = one.fall_part.values[one.after.values].astype(int)
    counts = {part: int((parts == i).sum()) for i, part in enumerate(trunk)}
    return ", ".join(f"{part} {n}" for part, n in sorted(counts.items(), key=lambda item: -item[1]) if n)
