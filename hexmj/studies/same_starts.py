"""What studies have in common: one controller plans, and the same starts walk in every cell."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

from hexmj.checks import check_types
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.measures.kinematic import settings
from hexmj.measures.walk_settings import WalkSettings
from hexmj.starts import check_draw
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class SameStarts:
    """Base of the studies."""

    controller: Controller
    """Plans the walks."""
    _: KW_ONLY
    n_starts: int = 100
    """Number of starts, the same in every cell."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    seed: int = 0
    """Of the starts."""
    conditions: Conditions = field(default_factory=Conditions)
    """All that are not varied."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""

    def __post_init__(self) -> None:
        settings_of(self.controller)  # now, not after the work
        check_types(self)
        check_draw(self.n_starts, self.seed)
        given, usual = self.conditions.values(), Conditions().values()
        if "ground" not in self.lists:
            check_ground(self.conditions)
        for name, several in self.lists.items():
            if given[name] != usual[name]:
                raise InputError(f"{name} = {given[name]}; expected {usual[name]}: {several} has all that are tried")

    @property
    def lists(self) -> Mapping[str, str]:
        """Conditions that are varied, and the names of the lists in which they are given."""
        return {}

    def walks(self, velocity: float, duration: float, conditions: Conditions) -> WalkSettings:
        """What a cell is told that walks all starts."""
        same = self.n_starts, self.seed, conditions, self.stride, self.acceleration
        return WalkSettings(self.controller, velocity, duration, *same)

    def labelled(self, table: "xr.Dataset", study: str, **own: Any) -> "xr.Dataset":
        """A result with all that is needed to run the study again: what all studies have, and its own; conditions but
        for lists."""
        same = self.observation_time, self.n_starts, self.seed, self.stride, self.acceleration
        conditions = {name: value for name, value in self.conditions.settings().items() if name not in self.lists}
        told = settings({self.controller.name: self.controller}, *same) | own | {"conditions": conditions}
        return table.assign_attrs(attributes({"study": study} | told))
