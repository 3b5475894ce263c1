"""Base class of the studies, and the cell that most have: physical walks of one controller at one velocity."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import begin, check_velocities
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.controllers.wrappers import Begins, FromSteadyState, by_protocol
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.measures.tables import WalkSettings, observed, over_start, settings
from hexmj.progress import Progress
from hexmj.starts import check_draw, draw_starts
from hexmj.timing import Acceleration, Stride
from hexmj.validate import choice, distinct

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settle import Settled

GROUND = "ground", "ground_height", "ground_at", "ground_length", "ground_seed"
"""Conditions that describe the ground; some studies set them and therefore hide them, see `Study.hidden`."""

UNITS = {
    **dict.fromkeys(("planned_loss", "dynamic_loss", "grounded_loss", "carried_loss", "fall"), "time unit"),
    **dict.fromkeys(("clearance", "tracking", "depth"), "mm"),
    **{"tilt": "rad", "slip": "mm/s"},
}
"""Field of `Outcomes` -> its unit; the other fields are plain numbers."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Settings that all studies share; every cell of a study walks from the same starts.

    A subclass adds `controller` or `controllers`, and `velocity` or `velocities` unless its velocities are fixed. It
    adds `observation_time`, `acceleration` and `protocol` only if users may choose them.
    """

    n_starts: int = 100
    """Number of random starts, the same in every cell."""
    seed: int = 0
    """Seed of the random starts."""
    conditions: Conditions = Conditions()
    stride: Stride = Stride()

    hidden: ClassVar[tuple[str, ...]] = ()
    """Conditions that the study sets itself; in `conditions` they must have their defaults."""
    protocol = "random"  # see `wrappers.Begins`

    def __post_init__(self) -> None:
        check_draw(self.n_starts, self.seed)
        distinct("controllers", [*self.plans()])
        for controller in self.plans().values():
            settings_of(controller)  # raises InputError now rather than after the computation
        given, default = self.conditions.values(), type(self).conditions.values()
        for name in (*self.hidden, *self.varies):
            if given[name] not in (default[name], *getattr(self, "axes", {}).get(name, ())):
                raise InputError(f"{name} = {given[name]}; expected {default[name]}, since the study sets it itself")
        choice("protocol", self.protocol, get_args(Begins))
        if (self.procedure or 0 in self.observed[0]) and self.protocol == "steady":
            raise InputError("protocol = steady allows neither an acceleration nor V = 0; use the protocol random")
        for name, values in self.varies.items():
            distinct(name, values)
        for conditions in self.varied:
            if "ground" not in self.hidden:
                check_ground(conditions)

    @property
    def varies(self) -> Mapping[str, Sequence[float]]:
        """Conditions that the study varies -> their values."""
        return getattr(self, "axes", {})

    @property
    def varied(self) -> list[Conditions]:
        """The conditions of walks at every combination of the values in `varies`; the last condition varies fastest."""
        rows = product(*self.varies.values())
        return [replace(self.conditions, **dict(zip(self.varies, row, strict=True))) for row in rows]

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """The velocities V_r and their observation times [time units], both (velocity,)."""
        own: Any = self
        velocities = own.velocities if hasattr(self, "velocities") else [own.velocity]
        return observed(velocities, getattr(self, "observation_time", "walk"), self.stride, self.procedure)

    @property
    def procedure(self) -> Acceleration | None:
        """The accelerating procedure of Eq. 11, or None."""
        return getattr(self, "acceleration", None)

    def plans(self) -> Mapping[str, Controller]:
        """Return all controllers of the study by name."""
        own: Any = self
        return (
            own.controllers if hasattr(self, "controllers") else {getattr(own.controller, "name", "?"): own.controller}
        )

    def walks(
        self, velocity: float, duration: float, conditions: Conditions, controller: Controller | None = None
    ) -> WalkSettings:
        """Return the settings of a cell in which all starts walk with a controller, by default the study's first."""
        controller = by_protocol(controller or next(iter(self.plans().values())), self.protocol)
        same = self.n_starts, self.seed, conditions, self.stride, self.procedure
        return WalkSettings(controller, velocity, duration, *same)

    def check_walks(self, velocities: Sequence[float]) -> None:
        """Raise InputError if a controller refuses a V_r."""
        for controller in self.plans().values():
            check_velocities(by_protocol(controller, self.protocol), velocities, self.stride, self.procedure)

    def labelled(self, table: "xr.Dataset", study: str, **own: Any) -> "xr.Dataset":
        """Return a result with all settings of the study as attributes, from which it can be repeated.

        Args:
            table: the result without these attributes.
            study: name of the study, by which `hexmj.plot` finds its figures.
            own: settings of this study only; they replace settings of all studies that have the same name.
        """
        time = getattr(self, "observation_time", "walk")
        shared = settings(self.plans(), time, self.n_starts, self.seed, self.stride, self.procedure)
        conditions = {k: v for k, v in self.conditions.settings().items() if k not in (*self.hidden, *self.varies)}
        made = {"study": study, "protocol": self.protocol} | shared | own | {"conditions": conditions}
        return table.assign_attrs(attributes(made))


@lru_cache(maxsize=8)
def settled_starts(n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None) -> "Settled":
    """Return the random starts of a seed after they have come to rest; cached, since all controllers share them."""
    from hexmj.physics.settle import settle

    return settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)


def outcome_table(
    walks: WalkSettings,
    which: np.ndarray | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Return every field of `Outcomes`, (start,), of the physical walks with these settings.

    `which` are the indices of the starts that walk, (n,), by default all.
    """
    from hexmj.measures.physical import physical_outcomes
    from hexmj.physics.settle import settle, settle_plan

    starts = walks.starts if which is None else walks.starts[which]
    if isinstance(walks.controller, FromSteadyState):
        plan = begin(walks.controller, starts, walks.velocity, walks.stride, threads=threads)
        settled = settle_plan(plan, walks.conditions, threads)
    elif which is not None:
        settled = settle(starts, walks.conditions, walks.stride, threads)
    else:
        settled = settled_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads)
    how: Any = {"starts": starts, "acceleration": walks.acceleration, "threads": threads, "progress": progress}
    outcomes = physical_outcomes(settled, walks.controller, walks.velocity, walks.duration, **how)
    return over_start(vars(outcomes), UNITS)
