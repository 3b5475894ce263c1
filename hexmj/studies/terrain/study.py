"""Real obstacles in physics: how often the insect falls once it has reached one.

The same starts walk on flat ground and towards every obstacle, the same way until a foot reaches it.  All are told to
walk so far that the hindmost foot could be one stride beyond the longest obstacle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import check_velocities
from hexmj.errors import InputError
from hexmj.measures.velocities import VELOCITY
from hexmj.starts import checked_list
from hexmj.studies.same_starts import SameStarts
from hexmj.studies.terrain.crossings import with_crossings
from hexmj.sweep import Cell, over_axes
from hexmj.timing import Stride
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

ObstacleKind = Literal["step", "gap", "hurdle", "rough"]
"""Kinds of ground that are not flat, see `Conditions.ground`."""

VARIED = {"ground": "grounds", "ground_height": "heights", "grasp": "grasps"}
"""Conditions that are given as lists, and the lists."""

OUTCOMES = {  # units, long_name
    "fall": ("time unit", "first contact of the trunk with the ground, or inf"),
    "fall_part": ("1", "index of the part that touched first, -1 for none"),
    "tilt": ("rad", "greatest tilt of the trunk"),
    "speed": ("1", "distance walked ahead over distance commanded, until the fall"),
}
"""What stands in the result of every walk, of `physics.outcomes.Outcomes`."""

FARTHER = Conditions(ground_at=80.0)
"""Walks have found their gait before they come to an obstacle."""

SIZED = {"heights": {"step", "hurdle", "rough"}, "lengths": {"gap"}}
"""Name of a list of sizes -> the obstacles that have them."""

TOLD = {"ground_length": "hurdle", "ground_seed": "rough"}
"""Condition that is the same for all obstacles -> the one that has it."""


@dataclass(frozen=True)
class Terrain(SameStarts):
    """The same starts on flat ground and to every obstacle, with and without grasping feet, at every velocity."""

    velocities: Sequence[float] = (0.2, 0.4, 0.6)
    """V_r, each 0 < V < 1."""
    grounds: Sequence[ObstacleKind] = ("step", "gap", "hurdle", "rough")
    """Kinds of obstacles, each once; flat ground comes first by itself."""
    heights: Sequence[float] = (2.0, 4.0, 6.0)
    """Of steps, hurdles and rough ground [mm], each once."""
    lengths: Sequence[float] = (2.5, 5.0, 10.0)
    """Of gaps [mm], each once."""
    grasps: Sequence[float] = (0.0, 1.0)
    """As `Conditions.grasp`, each once."""
    n_starts: int = field(default=30, kw_only=True)
    conditions: Conditions = field(default=FARTHER, kw_only=True)
    observation_time: str = field(default="distance", init=False)
    """All are told to walk as far."""
    acceleration: None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        v = checked_list(self.velocities)
        if not (v > 0).all():
            raise InputError(f"velocities = {v.tolist()}; expected V > 0, or no obstacle is ever reached")
        for name in ("grounds", "heights", "lengths", "grasps"):
            distinct(name, getattr(self, name))
        for name, grounds in SIZED.items():
            if not grounds & {*self.grounds} and [*getattr(self, name)] != [*getattr(Terrain, name)]:
                one = " or ".join(sorted(grounds))
                raise InputError(f"{name} = {getattr(self, name)}; expected {one} among the grounds")
        for name, ground in TOLD.items():
            if ground not in self.grounds and (told := self.conditions.values()[name]) != FARTHER.values()[name]:
                raise InputError(f"{name} = {told}; expected {ground} among the grounds")
        for grasp in self.grasps:
            replace(self.conditions, grasp=grasp)
        _ = self.obstacles

    @property
    def lists(self) -> Mapping[str, str]:
        """See `SameStarts.lists`."""
        return VARIED

    @property
    def obstacles(self) -> dict[str, Conditions]:
        """The conditions on flat ground and before each obstacle, by names such as 'step 2 mm'."""
        named = {"flat": self.conditions}
        for ground in self.grounds:
            name, sizes = ("ground_length", self.lengths) if ground == "gap" else ("ground_height", self.heights)
            for size in sizes:
                told = f"{ground} {float(size)}".removesuffix(".0")
                named[f"{told} mm"] = replace(self.conditions, ground=ground, **{name: size})
        return named

    @property
    def distance(self) -> float:
        """To which all starts are told to walk [mm]."""
        _, behind = reach(self.stride)
        return max(map(_end, self.obstacles.values())) + behind + self.stride.aep0 - self.stride.pep0

    def cells(self) -> list[Cell]:
        """A cell for each obstacle, grasp and velocity; see `sweep.Study`."""
        from hexmj.measures.outcome_table import outcome_table
        from hexmj.physics.settling import check_adhesion

        before = self.obstacles

        def cell(obstacle: str, grasp: float, velocity: float) -> Cell:
            name, conditions = f"{obstacle}-grasp-{grasp:g}-V-{velocity:g}", replace(before[obstacle], grasp=grasp)
            walks = self.walks(velocity, self.distance / velocity, conditions)
            return Cell(name, outcome_table, {"walks": walks}, 1 / velocity)

        check_velocities(self.controller, self.velocities, self.stride)
        for grasp in self.grasps:
            check_adhesion(replace(self.conditions, grasp=grasp), self.stride, self.seed)
        return [cell(one, grasp, v) for one in before for grasp in self.grasps for v in checked_list(self.velocities)]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """What became of the starts.

        Returns:
            Over (obstacle, grasp, velocity), the obstacle 'flat' first: `reached`, the number of starts that did not
            fall until a front foot was told to reach the obstacle, `flss`, the fraction of these that fell, with its
            95 % Wilson interval `flss_low`, `flss_high`, and `crossed`, the number that never fell and whose hind feet
            are beyond, on rough ground wherever they stand.  Over starts too: `OUTCOMES`, the `distance` walked [mm],
            and `after`, whether the start fell after it had reached the obstacle.
        """
        (ahead, behind), at = reach(self.stride), self.conditions.ground_at
        table = with_crossings(self._over_obstacles(data), self.distance, self.stride, at - ahead, behind)
        return self.labelled(table, "terrain", observation_time=f"{self.distance:g} / V", distance=self.distance)

    def _over_obstacles(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """The outcomes over (obstacle, grasp, velocity, start)."""
        before = self.obstacles
        sizes = {"obstacle": len(before), "grasp": len(self.grasps), "velocity": len(self.velocities)}
        end = [_end(one) for one in before.values()]
        grasp = {"units": "1", "long_name": "adhesion of a foot over the insect's weight"}
        table = over_axes(sizes, [one[list(OUTCOMES)] for one in data]).assign_coords(
            obstacle=list(before),
            ground=("obstacle", [one.ground for one in before.values()]),
            size=("obstacle", [_size(one) for one in before.values()], {"units": "mm"}),
            end=("obstacle", end, {"units": "mm", "long_name": "where the obstacle ends or has been climbed"}),
            grasp=("grasp", list(self.grasps), grasp),
            velocity=("velocity", checked_list(self.velocities), VELOCITY),
        )
        for name, (units, long_name) in OUTCOMES.items():
            table[name].attrs = {"units": units, "long_name": long_name}
        return table


def reach(stride: Stride) -> tuple[float, float]:
    """How far ahead of O a front foot and how far behind it a hind foot may stand [mm]."""
    origin = stride.geometry.origin
    return max(origin) + stride.aep0, -(min(origin) + stride.pep_min)


def _end(conditions: Conditions) -> float:
    """Where an obstacle ends, ahead of O at the start [mm]; a step where it has been climbed."""
    return conditions.ground_at + (conditions.ground_length if conditions.ground in ("gap", "hurdle") else 0.0)


def _size(conditions: Conditions) -> float:
    """What an obstacle is called by: the length of a gap, the height of anything else [mm]; 0 for flat ground."""
    return {"flat": 0.0, "gap": conditions.ground_length}.get(conditions.ground, conditions.ground_height)
