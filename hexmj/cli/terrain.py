"""`hexmj terrain`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import STEADY, Accelerating, ControllerName, Walks, hiding
from hexmj.cli.study_command import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import interval, table
from hexmj.conditions import Conditions
from hexmj.measures.figures import starts_in_words
from hexmj.studies import terrain
from hexmj.studies.terrain import FARTHER, ObstacleKind, terrain_figure

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

TABLED = ("flss", "flss_low", "flss_high", "reached", "crossed")
"""What is printed as JSON of every obstacle, grasp and velocity."""


@dataclass(frozen=True)
class Terrain(StudyCommand):
    """Options of `hexmj terrain`, which `commands.COMMANDS` describes."""

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
    walks: OmitArgPrefixes[Walks] = hiding(
        Walks(), ["observation_time"], "Each start walks a distance instead of a time."
    )
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    conditions: OmitArgPrefixes[Conditions] = hiding(FARTHER, terrain.Terrain.hidden)
    outputs = Outputs("walking to obstacles", "terrain.nc", {"terrain.png": terrain_figure})

    def study(self) -> terrain.Terrain:
        controller = self.controlled.controller(self.model)
        self.refuse_contact_gap(controller)
        return terrain.Terrain(
            controller,
            self.velocities,
            self.grounds,
            self.heights,
            self.lengths,
            self.grasps,
            n_starts=self.starts,
            **self.steady,
        )

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Every obstacle, grasp and velocity."""
        return lists_of(result[list(TABLED)])

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """A table of the obstacles, and the conditions."""
        name = self.controlled.controller(self.model).name
        yield (
            f"{name}, {starts_in_words(self.starts)} at each velocity: FLSS once the obstacle has been reached, with"
            " 95 % intervals; who falls on the way to it does not count"
        )
        yield _table(result, self.conditions.body.trunk)
        distance = result.attrs["distance"]
        walked = {
            "walks": replace(self.walks, observation_time=f"{distance:g} / V"),
            "conditions": self._on_the_roughest,
        }
        yield replace(self, **walked).conditions_line(varied=terrain.Terrain.hidden, walked=distance)

    @property
    def _on_the_roughest(self) -> Conditions:
        """With the ground, where one is rough, whose bumps some walks may get past."""
        ground = {"ground": "rough", "ground_height": max(self.heights)} if "rough" in self.grounds else {}
        return replace(self.conditions, **ground)


def _table(result: "xr.Dataset", trunk: tuple[str, ...]) -> "Table":
    """A row for each obstacle and grasp, a column for each velocity."""
    velocities = result.velocity.values
    rows = []
    for name in result.obstacle.values:
        for grasp in result.grasp.values:
            one = result.sel(obstacle=name, grasp=grasp)
            frequencies = (interval(one.sel(velocity=v), "flss") for v in velocities)
            crossed = f"{one.crossed.sum().item()} of {one.reached.sum().item()}"
            rows.append((name, f"{grasp:g}", *frequencies, crossed, _parts(one, trunk)))
    return table(("obstacle", "grasp", *(f"V = {v:g}" for v in velocities), "crossed", "fell on"), rows)


def _parts(one: "xr.Dataset", trunk: tuple[str, ...]) -> str:
    """Parts of the trunk that touched the ground first after an obstacle had been reached, most frequent first."""
    parts = one.fall_part.values[one.after.values].astype(int)
    counts = {part: int((parts == i).sum()) for i, part in enumerate(trunk)}
    return ", ".join(f"{part} {n}" for part, n in sorted(counts.items(), key=lambda item: -item[1]) if n)
