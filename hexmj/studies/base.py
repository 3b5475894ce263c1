"""Base of the studies: settings, checks, cells, and the attributes of their results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import check_velocities
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.measures.cells import WalkSettings
from hexmj.measures.tables import observed, settings
from hexmj.starts import check_draw
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr


GROUND = "ground", "ground_height", "ground_at", "ground_length", "ground_seed"
"""Conditions of the ground, which some studies set."""


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
        controller: Controller = getattr(self, "controller")  # noqa: B009  (a field of the subclass)
        return {getattr(controller, "name", "?"): controller}

    def walks(self, velocity: float, duration: float, conditions: Conditions) -> WalkSettings:
        """Return the settings of a cell in which all starts walk."""
        (controller,) = self.plans().values()
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
