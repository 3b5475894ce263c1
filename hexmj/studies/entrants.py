"""Controllers that take part in a league or an ablation, by name, and how they begin."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller, FeedbackPlan, is_steerable
from hexmj.controllers.registry import VARIED, known_names, load_controller
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.starts import draw_starts
from hexmj.timing import Stride

IDEAL = "-ideal"
"""End of the name of an entrant that begins at an ideal start."""

NETWORK = ("uncoordinated", "hws", "ldvs", "own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
"""Weight sets of the 1998 network that take part."""

EVERYONE = (*NETWORK, *BASELINES, *(f"{name}{IDEAL}" for name in ("wilson", "graham")))
"""The whole league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham-ideal")
"""Entrants of a quick look."""


@runtime_checkable
class HasIdealStart(Protocol):
    """A controller that walks its gait from some start on."""

    def ideal_start(self, velocity: float, stride: Stride) -> np.ndarray:
        """Return tips at time 0, (1, leg) [mm]."""
        ...


@dataclass(frozen=True)
class Entrant:
    """A controller, and how it begins."""

    controller: Controller
    ideal: bool = False
    """Whether it begins at its `ideal_start`, the same for all walks."""

    def __post_init__(self) -> None:
        if self.ideal and not isinstance(self.controller, HasIdealStart):
            raise InputError(f"controller = {self.controller.name} has no ideal_start")

    def starts(self, n_starts: int, seed: int, velocity: float, stride: Stride) -> np.ndarray:
        """Return random starts, (start, leg) [mm], or the ideal one alone."""
        if not (self.ideal and isinstance(self.controller, HasIdealStart)):
            return draw_starts(n_starts, seed, stride)
        start = np.array(self.controller.ideal_start(velocity, stride), dtype=float)
        if start.shape != (1, len(LEGS)):
            raise InputError(f"ideal_start of {self.controller.name} has the shape {start.shape}; expected (1, 6)")
        return start

    def reading(self, velocity: float, stride: Stride) -> Controller | None:
        """Return the controller with sensory feedback, if it has it or its plans can be steered."""
        if isinstance(begin(self.controller, draw_starts(1, 0, stride), velocity, stride), FeedbackPlan):
            return self.controller
        return SensoryFeedback(self.controller) if self.steerable else None

    @property
    def steerable(self) -> bool:
        """Whether the controller can be halted, and a leg of it stopped."""
        return is_steerable(self.controller)


def entrants(names: Sequence[str], load: Callable[[str], Controller] = load_controller) -> Mapping[str, Entrant]:
    """Return entrants by short names, see `short_names`, in their order.

    Args:
        names: of controllers, with the end `IDEAL` if they begin at an ideal start.
        load: returns a controller by its name.

    Raises:
        InputError: there is no such controller, or it has no ideal start.
    """
    plain = {name: name.removesuffix(IDEAL) for name in names}
    found = {name: load(name) for name in plain.values()}
    short = short_names(found)
    return {short[own] + IDEAL * (own != name): Entrant(found[own], ideal=own != name) for name, own in plain.items()}


def short_names(found: Mapping[str, Controller]) -> dict[str, str]:
    """Return distinct names for tables: known names as they are, others as the controllers call themselves.

    Args:
        found: controllers by the names that `load_controller` was given.
    """
    known, short = {*known_names()}, {}
    for name, controller in found.items():
        varied = VARIED.fullmatch(name)
        short[name] = name if (varied["name"] if varied else name) in known else controller.name
    often = Counter(short.values())
    return {name: name if often[shown] > 1 else shown for name, shown in short.items()}
