"""A controller whose senses are poor: positions are noisy, and everything comes late."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from hexmj.checks import check_types
from hexmj.controllers.protocol import Controller, FeedbackPlan, Sensed, check_controller_type, limits_within
from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk


@dataclass(frozen=True)
class PoorSenses:
    """A controller whose plans read the legs, told of their tips inexactly, or of everything late.

    What reads loads or contacts alone, as some rivals do, feels no noise.
    """

    controller: Controller
    """Plans and reads."""
    noise: float = 0.0
    """Standard deviation of the error of each coordinate of each tip, new and independent at every step, as a part of
    AEP_0 - PEP_0."""
    delay: float = 0.0
    """How late everything is told [time units], to the nearest step of the plan."""

    def __post_init__(self) -> None:
        check_types(self)
        check_controller_type(self.controller)
        if not (0 <= self.noise <= 10 and 0 <= self.delay <= 1000):
            raise InputError(
                f"noise = {self.noise}, delay = {self.delay}; expected 0 to 10 step ranges, and 0 to 1000 time units"
            )

    @property
    def name(self) -> str:
        """That of the controller that plans, and what is different."""
        return f"{self.controller.name}, noise {self.noise:g}, delay {self.delay:g}"

    check_velocity = property(limits_within)

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> "PoorlyToldPlan":
        """See `protocol.Controller.begin`.

        Raises:
            InputError: plans that read nothing, or a delay that is no step of theirs.
        """
        late = round(self.delay / stride.dt)
        if self.delay and not late:
            raise InputError(
                f"delay = {self.delay:g} with steps of {stride.dt:g} time units; expected at least one step"
            )
        plan = self.controller.begin(starts, velocity, stride, acceleration, threads)
        if not isinstance(plan, FeedbackPlan):
            raise InputError(f"poor senses of {self.controller.name}; expected a controller whose plans read the legs")
        return PoorlyToldPlan(plan, self.noise * (stride.aep0 - stride.pep0), late)


class PoorlyToldPlan:
    """A `protocol.FeedbackPlan` that is told inexactly or late; the error of a start depends on nothing but it."""

    def __init__(self, plan: FeedbackPlan, error: float, late: int) -> None:
        """Around a plan at time 0; `error` [mm], `late` in steps."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self._error, self.made_for = plan, error, getattr(plan, "made_for", None)
        self._draws = [np.random.default_rng(np.frombuffer(start.tobytes(), np.uint32)) for start in plan.starts]
        self._coming: deque[Sensed] = deque()
        self._late = late

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        walk = self._plan.advance(steps)
        self.done = self._plan.done
        return walk

    def sense(self, sensed: Sensed) -> None:
        """Hand on what was told some steps ago, of those that still walk; nothing until then."""
        if self._error:
            errors = [self._draws[i].standard_normal(sensed.tips.shape[1:]) for i in sensed.ids]
            sensed = replace(sensed, tips=sensed.tips + self._error * np.array(errors))
        self._coming.append(sensed)
        if len(self._coming) > self._late:
            self._plan.sense(self._coming.popleft())
