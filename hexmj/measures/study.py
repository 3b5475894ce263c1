"""Base of the studies, and the cells that most of them have: physical walks of one controller at one velocity."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import check_velocities
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.errors import InputError, OutOfReach, SimulationError, StillThrown
from hexmj.io import attributes
from hexmj.measures.tables import WalkSettings, observed, over_start, settings
from hexmj.progress import Progress
from hexmj.starts import check_draw, draw_starts
from hexmj.timing import Acceleration, Stride
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.measures.physical import PhysicalWalk
    from hexmj.physics.settle import Settled

GROUND = "ground", "ground_height", "ground_at", "ground_length", "ground_seed"
"""Conditions of the ground, which some studies set."""

UNITS = {
    **dict.fromkeys(("planned_loss", "measured_loss", "fall", "topple"), "time unit"),
    **dict.fromkeys(("clearance", "tracking", "depth"), "mm"),
    **{"tilt": "rad", "slip": "mm/s"},
}
"""Units of `Outcomes`; the others are numbers."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Settings that all studies share; the same starts walk in every cell.

    A subclass has `controller` or `controllers`, and `velocity` or `velocities` unless its velocities are fixed.
    Fields `observation_time` and `acceleration` are there only if they can be chosen.
    """

    n_starts: int = 100
    """Number of random starts, the same in every cell."""
    seed: int = 0
    """Seed of the random starts."""
    conditions: Conditions = Conditions()
    stride: Stride = Stride()

    hidden: ClassVar[tuple[str, ...]] = ()
    """Conditions that the study sets itself, so that they must keep their defaults."""

    def __post_init__(self) -> None:
        check_draw(self.n_starts, self.seed)
        distinct("controllers", [*self.plans()])
        for controller in self.plans().values():
            settings_of(controller)  # raises before the work, not after it
        given, usual = self.conditions.values(), type(self).conditions.values()
        for name in self.set_by_study:
            if given[name] != usual[name]:
                raise InputError(f"{name} = {given[name]}; the study sets it, so that it must stay {usual[name]}")
        if "ground" not in self.set_by_study:
            check_ground(self.conditions)
        _ = self.observed

    @property
    def set_by_study(self) -> tuple[str, ...]:
        """The conditions `hidden`, and others that depend on the study's fields."""
        return self.hidden

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        own: Any = self
        velocities = own.velocities if hasattr(self, "velocities") else [own.velocity]
        return observed(velocities, getattr(self, "observation_time", "walk"), self.stride, self.procedure)

    @property
    def procedure(self) -> Acceleration | None:
        """The accelerating procedure, if there is one."""
        return getattr(self, "acceleration", None)

    def plans(self) -> Mapping[str, Controller]:
        """Return all controllers by name."""
        own: Any = self
        return (
            own.controllers if hasattr(self, "controllers") else {getattr(own.controller, "name", "?"): own.controller}
        )

    def walks(
        self, velocity: float, duration: float, conditions: Conditions, controller: Controller | None = None
    ) -> WalkSettings:
        """Return the settings of a cell in which all starts walk with a controller, by default the only one."""
        controller = controller or next(iter(self.plans().values()))
        same = self.n_starts, self.seed, conditions, self.stride, self.procedure
        return WalkSettings(controller, velocity, duration, *same)

    def check_walks(self, velocities: Sequence[float], *conditions: Conditions) -> None:
        """Raise InputError if a controller refuses a velocity, or feet with adhesion cannot be settled."""
        from hexmj.physics.settle import check_adhesion

        for controller in self.plans().values():
            check_velocities(controller, velocities, self.stride, self.procedure)
        for varied in conditions:
            check_adhesion(varied, self.stride, self.seed)

    def labelled(self, table: "xr.Dataset", study: str, **own: Any) -> "xr.Dataset":
        """Return a result with the settings that repeat the study as attributes.

        Args:
            table: the result.
            study: its name, which `hexmj.plot` reads.
            own: settings beside those of all studies, or in their place.
        """
        time = getattr(self, "observation_time", "walk")
        made = settings(self.plans(), time, self.n_starts, self.seed, self.stride, self.procedure)
        conditions = {k: v for k, v in self.conditions.settings().items() if k not in self.set_by_study}
        return table.assign_attrs(attributes({"study": study} | made | own | {"conditions": conditions}))


@lru_cache(maxsize=1)
def settled_starts(n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None) -> "Settled":
    """Return the seed's starts at rest; cached, since all controllers begin with the same starts."""
    from hexmj.physics.settle import settle

    return settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)


@lru_cache(maxsize=1)
def standing_starts(
    n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None
) -> np.ndarray:
    """Return the indices of the seed's starts that come to rest on six feet; cached for the other velocities."""
    from hexmj.physics.settle import settle

    starts, everyone = draw_starts(n_starts, seed, stride), np.arange(n_starts)
    parts = [part for part, _ in by_halves(everyone, lambda part: settle(starts[part], conditions, stride, threads))]
    return np.concatenate([everyone[:0], *parts])


def by_halves(
    which: np.ndarray, walk: Callable[[np.ndarray], Any], diverging: bool = False
) -> Iterator[tuple[np.ndarray, Any]]:
    """Yield parts of the starts with what they return; starts that have no outcome are left out.

    A start has none if it cannot stand, its tips are out of reach or a push still acts at the end.

    Args:
        which: indices of the starts, (n,).
        walk: walks some of the starts, (n,); the outcome of a start must not depend on the others.
        diverging: whether walks that diverge are left out too; else they are an error.
    """
    try:
        yield which, walk(which)
    except (OutOfReach, SimulationError, StillThrown) as error:
        if getattr(error, "state", None) and not diverging:
            raise
        for half in np.array_split(which, 2) if len(which) > 1 else ():
            yield from by_halves(half, walk, diverging)


def kept_walk(walks: WalkSettings, starts: np.ndarray, threads: int | None) -> "PhysicalWalk":
    """Return physical walks, kept whole, from some starts, (start, leg) [mm]."""
    from hexmj.measures.physical import physical_walk

    how: Any = {"conditions": walks.conditions, "stride": walks.stride, "acceleration": walks.acceleration}
    return physical_walk(starts, walks.controller, walks.velocity, walks.duration, **how, threads=threads)


def outcome_table(walks: WalkSettings, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
    """Return every field of `Outcomes` over start."""
    from hexmj.measures.physical import physical_outcomes

    settled = settled_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads)
    outcomes = physical_outcomes(
        settled, walks.controller, walks.velocity, walks.duration,
        acceleration=walks.acceleration, threads=threads, progress=progress,
    )  # fmt: skip
    return over_start(vars(outcomes), UNITS)
