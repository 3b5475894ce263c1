"""A controller that meets a disturbance: its plan until then, what becomes of it, and its plan again."""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.checked_plans import begin_at_speed
from hexmj.controllers.protocol import FeedbackPlan, Sensed, SteerableController, SteerablePlan, check_steerable
from hexmj.errors import InputError
from hexmj.studies.disturbance.disturbances import NEVER, Disturbance
from hexmj.studies.disturbance.strategies import Postures, Rest, reorganise, stand
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk, copied, joined

PAUSE = 4.0
"""Time for which a halted body stands before anything else happens [time units]; up to V_p = 200 mm/s feet that take
20 ms are lowered meanwhile."""


@dataclass(frozen=True, eq=False)
class Disturbed:
    """A controller with one disturbance of every start, and a strategy against it.

    Without a strategy a halted body stands for `PAUSE`, then the plan starts from there; any other goes on at once.
    With postures it is halted too, reorganises its legs and goes on from the posture, its states included.  With an
    acceleration it goes on with V_r(0), and Eq. 11 brings it back to V.  Where the plan is told of the legs, the leg
    that is stopped is one that protracts as they are then; if none does, the next one that does.
    """

    controller: SteerableController
    """What plans before and afterwards."""
    disturbance: Disturbance
    """Of the starts that it begins with."""
    postures: Postures | None = None
    """Reorganise the legs to the nearest of these."""
    slows: bool = False
    """Slow down to V_r(0) of the acceleration; it takes place only then."""

    @property
    def name(self) -> str:
        """That of the controller that plans, and what is different."""
        return f"{self.controller.name}, disturbed"

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> "DisturbedPlan":
        """See `protocol.Controller.begin`.

        Raises:
            InputError: a controller whose plans cannot be steered; a disturbance of other starts.
        """
        check_steerable(self.controller)
        if (count := len(self.disturbance.step)) != len(starts):
            raise InputError(f"a disturbance of {count} starts; expected one of {len(starts)}")
        plan = begin_at_speed(self.controller, starts, velocity, stride, acceleration, threads)
        return DisturbedReadingPlan(self, plan) if isinstance(plan, FeedbackPlan) else DisturbedPlan(self, plan)


class DisturbedPlan:
    """A `protocol.SteerablePlan`: the walk of a `Disturbed` controller."""

    def __init__(self, controller: Disturbed, plan: SteerablePlan) -> None:
        """Around a plan at time 0."""
        self._plan, self._disturbance, self._postures = plan, controller.disturbance, controller.postures
        self.starts, self.stride, self.done = plan.starts, plan.stride, 0
        self.made_for, self._slows = getattr(plan, "made_for", None), controller.slows
        self._step, self._told = self._disturbance.step.copy(), False
        self._stops = self._disturbance.kind == "halt" or self._postures is not None
        self._rests: dict[int, Rest] = {}
        self._tips, self._standing = np.array(self.starts), np.ones(self.starts.shape, dtype=bool)
        self._beside = np.tile(np.array(self.stride.geometry.y, dtype=float), (len(self.starts), 1))
        self._held = self._beside.copy()
        self.resumed = np.full(len(self.starts), NEVER)
        """(start,) steps before the plan goes on again, known as soon as the start has been disturbed."""

    def advance(self, steps: int) -> PlannedWalk:
        """The next `steps` steps; they do not depend on how the walk is divided into calls."""
        end, parts = self.done + steps, []
        while self.done < end:
            now = self._step == self.done
            awaited = now & self._told & self._disturbance.awaited(self._plan.standing)
            self._step[awaited] += 1
            self._disturb(now & ~awaited)
            self._resume(self.resumed == self.done)
            coming = np.concatenate([self._step, self.resumed, [end]])
            parts.append(self._go_on(int(coming[coming > self.done].min()) - self.done))
        return joined(parts)

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Go on from these tips [mm] and states, both (start, leg); a start that rests keeps to its rest."""
        self._plan.see(tips, standing)
        self._told = True

    @property
    def tips(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._plan.tips

    @property
    def standing(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._plan.standing

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._plan.restart(which, tips)

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._plan.slow_down(which)

    def _disturb(self, which: np.ndarray) -> None:
        """Let it happen to these starts, (start,): how long they rest, and the legs with which they go on."""
        tips, standing = self._disturbance.legs(self._plan.tips, self._plan.standing)
        self._tips[which], self._standing[which], self._held[which] = tips[which], standing[which], self._beside[which]
        self.resumed[which] = self.done
        for start in np.flatnonzero(which & self._stops).tolist():
            rest = self._rest(tips[start])
            self._rests[start] = rest
            self.resumed[start] += len(rest.tips)
            self._tips[start] = rest.tips[-1]
            if self._postures:
                self._standing[start] = self._postures.standing[self._postures.nearest(tips[start])]

    def _rest(self, tips: np.ndarray) -> Rest:
        """What a start does that is halted with these tips, (leg,) [mm]."""
        pause = stand(tips, round(PAUSE / self.stride.dt))
        if not self._postures:
            return pause
        moves = reorganise(tips, self._postures.tips[self._postures.nearest(tips)], self.stride)
        return Rest(np.concatenate([pause.tips, moves.tips]), np.concatenate([pause.standing, moves.standing]))

    def _resume(self, which: np.ndarray) -> None:
        """Let the plan of these starts, (start,), go on, or start again after a rest."""
        if not which.any():
            return
        if self._stops:
            self._plan.restart(which.copy(), self._tips.copy())
        if self._slows:
            self._plan.slow_down(which.copy())
        legs = which[:, None]
        self._plan.see(np.where(legs, self._tips, self._plan.tips), np.where(legs, self._standing, self._plan.standing))

    def _go_on(self, steps: int) -> PlannedWalk:
        """Steps in which nothing new happens; what is planned for a start that rests is not used."""
        before = self.done
        walk = copied(self._plan.advance(steps))
        self.done, self._beside = self.done + steps, walk.y[-1].copy()
        for start, rest in self._rests.items():
            if before < self.resumed[start]:
                rows = slice(before - self._step[start], before - self._step[start] + steps)
                walk.velocity[:, start] = 0.0
                walk.x[:, start], walk.stance[:, start] = rest.tips[rows], rest.standing[rows]
                walk.y[:, start], walk.height[:, start] = self._held[start], np.nan
                walk.aep[:, start] = np.where(rest.moves_back[rows], np.nan, self.stride.aep0)
        return walk


class DisturbedReadingPlan(DisturbedPlan):
    """The same of a `protocol.FeedbackPlan`."""

    def sense(self, sensed: Sensed) -> None:
        """Hand on what the legs tell."""
        self._told = True
        self._plan.sense(sensed)  # pyright: ignore[reportAttributeAccessIssue]
