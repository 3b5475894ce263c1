"""One who takes part: any controller, from the random starts S or, as metronomes may, from a start of its own."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from hexmj.checks import check_types, numbers
from hexmj.controllers.checked_plans import begin, said
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller, FeedbackPlan, check_controller_type, is_steerable
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.starts import draw_starts
from hexmj.timing import Stride


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
        check_types(self)
        check_controller_type(self.controller)
        if self.ideal and not isinstance(self.controller, HasIdealStart):
            raise InputError(f"an ideal start of {self.controller.name}; expected a controller with ideal_start")

    def starts(self, n_starts: int, seed: int, velocity: float, stride: Stride) -> np.ndarray:
        """Random starts, (start, leg) [mm], or the ideal one alone.

        Raises:
            InputError: an ideal start that is something else.
        """
        if not (self.ideal and isinstance(self.controller, HasIdealStart)):
            return draw_starts(n_starts, seed, stride)
        with said(name := f"{self.controller.name}, ideal_start"):
            start, again = (numbers(name, self.controller.ideal_start(velocity, stride)) for _ in range(2))
        if not np.array_equal(start, again, equal_nan=True):
            raise InputError(f"{name} gave another start when it was asked again; expected the same numbers each time")
        if np.shape(start) != (1, len(LEGS)):
            raise InputError(
                f"{name} gave something of the shape {np.shape(start)}; expected the tips of one start, (1, 6)"
            )
        return start

    def reading(self, velocity: float, stride: Stride) -> Controller | None:
        """The same controller reading the legs, if it can: by itself, or because its plans, which are asked for at V_r
        and with the stride that it is to walk with, can be steered."""
        if isinstance(begin(self.controller, draw_starts(1, 0, stride), velocity, stride), FeedbackPlan):
            return self.controller
        return SensoryFeedback(self.controller) if self.steerable else None

    @property
    def steerable(self) -> bool:
        """Whether it can be halted, and a leg of it stopped."""
        return is_steerable(self.controller)
