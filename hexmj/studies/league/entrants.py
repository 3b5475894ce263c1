"""Who takes part: any controller, from the random starts S or, as metronomes may, from a start of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from hexmj.controllers.asking import begin
from hexmj.controllers.named import load_controller
from hexmj.controllers.protocol import Controller, ReadingPlan, SteerableController, check_controller_type
from hexmj.controllers.reads_legs import ReadsLegs
from hexmj.controllers.rivals import RIVALS
from hexmj.errors import InputError
from hexmj.starts import draw_starts
from hexmj.timing import Stride

IDEAL = "-ideal"
"""What the name of an entrant ends with that begins at an ideal start."""

NETWORK = ("uncoordinated", "hws", "ldvs", "own", "own-0.1", "own-0.5", "robust-0.1", "lasting")
"""Sets of the 1998 network that take part."""

EVERYONE = (*NETWORK, *RIVALS, *(f"{name}{IDEAL}" for name in ("wilson", "graham")))
"""The whole league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham-ideal")
"""For a quick look."""


@runtime_checkable
class HasIdealStart(Protocol):
    """A controller with a gait that it walks from some start on."""

    def ideal_start(self, velocity: float, stride: Stride) -> np.ndarray:
        """Tips at time 0, (1, leg) [mm]."""
        ...


@dataclass(frozen=True)
class Entrant:
    """A controller, and how it begins."""

    controller: Controller
    """Plans the walks."""
    ideal: bool = False
    """Whether it begins at its `ideal_start`, the same for all walks."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)
        if self.ideal and not isinstance(self.controller, HasIdealStart):
            raise InputError(f"an ideal start of {self.controller.name}; expected a controller with ideal_start")

    def starts(self, n_starts: int, seed: int, velocity: float, stride: Stride) -> np.ndarray:
        """Random starts, (start, leg) [mm], or the ideal one alone."""
        if self.ideal and isinstance(self.controller, HasIdealStart):
            return self.controller.ideal_start(velocity, stride)
        return draw_starts(n_starts, seed, stride)

    @property
    def reading(self) -> Controller | None:
        """The same controller reading the legs, if it can: by itself, or because its plans can be steered."""
        if isinstance(begin(self.controller, draw_starts(1, 0), 0.5, Stride()), ReadingPlan):
            return self.controller
        return ReadsLegs(self.controller) if self.steerable else None

    @property
    def steerable(self) -> bool:
        """Whether it can be halted, and a leg of it stopped."""
        return isinstance(self.controller, SteerableController)


def entrants(names: tuple[str, ...]) -> Mapping[str, Entrant]:
    """Entrants by the names of their controllers, which end with `IDEAL` where they begin at an ideal start.

    Raises:
        InputError: no such controller, or one without an ideal start.
    """
    return {name: Entrant(load_controller(name.removesuffix(IDEAL)), name.endswith(IDEAL)) for name in names}
