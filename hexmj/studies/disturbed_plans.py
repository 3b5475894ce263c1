"""Plans with a disturbance (paper, Section 6), and the reorganisation of legs, the paper's first strategy.

Reorganisation moves the legs to the nearest of a few postures of undisturbed walking. The legs also continue with the
states, swing or stance, of that posture, since tip positions alone do not keep the walk stable.
"""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import (
    Controller,
    FeedbackPlan,
    Sensed,
    SteerableController,
    SteerablePlan,
)
from hexmj.controllers.wrappers import WrappedPlan
from hexmj.errors import InputError
from hexmj.gaits import steady_state_gait
from hexmj.stability import stability_margin, walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, copied, joined

Kind = Literal["halt", "leg", "push"]
"""Disturbance: all legs halt, one swinging leg is stopped, or the body is pushed, which does not change the plan."""

NEVER = 2**62
"""Step number that stands for an event that has not happened yet."""

POSTURES = 36
"""Number of postures collected over one period; unstable postures are then dropped."""

CANDIDATES = 20
"""Number of random starts walked to collect postures from the first that reaches a stable steady-state gait."""

PAUSE = 4.0
"""Time for which a halted body stands [time units]. Up to V_p = 200 mm/s it exceeds the 20 ms of lowering a foot."""


@dataclass(frozen=True, eq=False)
class Disturbance:
    """One disturbance of the same kind in the walk of every start."""

    kind: Kind
    step: np.ndarray
    """(start,) number of steps of the plan before the disturbance."""
    leg: np.ndarray
    """(start,) index of the leg that kind 'leg' stops; if it stands, the next swinging leg in order is stopped."""

    def awaited(self, standing: np.ndarray) -> np.ndarray:
        """Return whether each start must wait for a swinging leg, (start,), given which legs stand, (start, leg)."""
        return (self.kind == "leg") & np.all(standing, axis=1)

    def legs(self, tips: np.ndarray, standing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return tips [mm] and whether legs stand, both (start, leg), after a disturbance at this moment."""
        if self.kind == "halt":
            return tips, np.ones_like(standing)
        if self.kind == "leg":
            inorder = (self.leg[:, None] + np.arange(6)) % 6
            first = np.argmin(np.take_along_axis(standing, inorder, axis=1), axis=1)
            return tips, standing | (np.arange(6) == (self.leg + first)[:, None] % 6)
        return tips, standing


@dataclass(frozen=True, eq=False)
class Postures:
    """Statically stable postures of undisturbed walking."""

    tips: np.ndarray
    """(posture, leg) tip positions [mm]."""
    standing: np.ndarray
    """(posture, leg) whether each leg is in stance."""

    def nearest(self, tips: np.ndarray) -> int:
        """Return the index of the posture with the lowest Euclidean distance to six tips, (leg,) [mm]."""
        return int(np.argmin(((self.tips - tips) ** 2).sum(axis=1)))


def collect_postures(controller: Controller, velocity: float, seed: int, stride: Stride) -> Postures:
    """Return the statically stable among `POSTURES` postures of one period of a steady-state gait at this velocity.

    Raises:
        InputError: no start reaches a stable periodic gait.
    """
    gait = steady_state_gait(controller, velocity, n_starts=CANDIDATES, seed=seed, stride=stride)
    stable = gait.periodic & gait.stable
    if not stable.any():
        raise InputError(f"strategy 'reorganise': {controller.name} has no stable steady gait at V = {velocity:g}")
    start = int(np.argmax(stable))
    plan = begin(controller, draw_starts(CANDIDATES, seed, stride)[start : start + 1], velocity, stride)
    plan.advance(round(gait.reached[start] / stride.dt))
    walk = plan.advance(round(gait.period[start] / stride.dt))
    rows = np.linspace(0, len(walk.time), POSTURES, endpoint=False).astype(int)
    rows = rows[walk_margin(walk)[rows, 0] > 0]
    return Postures(walk.x[rows, 0], walk.stance[rows, 0])


def reorganise(tips: np.ndarray, goal: np.ndarray, stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Move one leg after the other to its goal; return tips [mm] and whether legs stand, both (step, leg).

    The next leg to move is the leg without which the stability margin is widest. Legs within a step of their goal stay.

    Args:
        tips: tips of the legs, all of which stand, (leg,) [mm].
        goal: tips to which the legs move at V_p, (leg,) [mm].
        stride: stride with the time step and the lines of the tips.
    """
    now, left = tips.copy(), [int(leg) for leg in np.flatnonzero(np.abs(goal - tips) > stride.dt)]
    rows, states = [], []

    def margin_without(leg: int) -> float:
        feet = np.stack([now + np.array(stride.geometry.origin), np.array(stride.geometry.y)], axis=-1)
        return float(stability_margin(feet, np.arange(6) != leg, threads=1))

    while left:
        leg = max(left, key=margin_without)
        left.remove(leg)
        way = goal[leg] - now[leg]
        for n in range(int(np.ceil(abs(way) / stride.dt)) - 1, -1, -1):
            now[leg] = goal[leg] - np.sign(way) * n * stride.dt
            rows.append(now.copy())
            states.append((np.arange(6) != leg) | (n == 0))
    return np.array(rows).reshape(-1, 6), np.array(states, dtype=bool).reshape(-1, 6)


@dataclass(frozen=True, eq=False)
class Disturbed:
    """A controller whose plans contain one disturbance of every start, and a strategy against it.

    Without a strategy, a halted body stands for `PAUSE` and then restarts from its tips; other walks continue at once.
    With `postures`, the body also halts, moves its legs to a posture, and continues with its tips and leg states. With
    `slows`, the walk continues at V_r(0) and accelerates to V_r by Eq. 11. With sensory feedback, kind 'leg' stops a
    leg that swings in the simulation; if all legs stand, the plan waits for a swing.
    """

    controller: SteerableController
    """Controller that plans before and after the disturbance."""
    disturbance: Disturbance
    """Disturbance of the starts, in the order in which `begin` receives them."""
    postures: Postures | None = None
    """Postures for the strategy 'reorganise'; None leaves the strategy out."""
    slows: bool = False
    """Whether the walk continues at V_r(0) of the acceleration after the disturbance."""

    @property
    def name(self) -> str:
        """Name of the inner controller, followed by ', disturbed'."""
        return f"{self.controller.name}, disturbed"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> "DisturbedPlan":
        """Return a disturbed plan; see `protocol.Controller.begin`."""
        arguments = self.controller, starts, velocity, stride, acceleration, threads
        plan = cast(SteerablePlan, begin(*arguments, at_speed=True))
        return DisturbedFeedbackPlan(self, plan) if isinstance(plan, FeedbackPlan) else DisturbedPlan(self, plan)


class DisturbedPlan(WrappedPlan):
    """The plan that a `Disturbed` controller begins: a `protocol.SteerablePlan` with a disturbance."""

    def __init__(self, controller: Disturbed, plan: SteerablePlan) -> None:
        """Wrap a plan that is at time 0."""
        super().__init__(plan)
        self._disturbance, self._postures, self._slows = controller.disturbance, controller.postures, controller.slows
        self._step, self._sensed = self._disturbance.step.copy(), False
        self.restart, self.slow_down = plan.restart, plan.slow_down
        self._stops = self._disturbance.kind == "halt" or self._postures is not None
        self._rests: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # start -> tips and leg states of its rest
        self._tips, self._standing = np.array(self.starts), np.ones(self.starts.shape, dtype=bool)
        self._beside = np.tile(np.array(self.stride.geometry.y, dtype=float), (len(self.starts), 1))
        self._held = self._beside.copy()
        self.resumed = np.full(len(self.starts), NEVER)
        """(start,) step at which the plan continues after the disturbance; `NEVER` until the start is disturbed."""

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps; two calls give the same steps as one call with the sum of their steps."""
        end, parts = self.done + steps, []
        while self.done < end:
            now = self._step == self.done
            awaited = now & self._sensed & self._disturbance.awaited(self._plan.standing)
            self._step[awaited] += 1
            self._disturb(now & ~awaited)
            self._resume(self.resumed == self.done)
            coming = np.concatenate([self._step, self.resumed, [end]])
            parts.append(self._go_on(int(coming[coming > self.done].min()) - self.done))
        return joined(parts)

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Continue from tips [mm] and leg states, both (start, leg); starts that rest after a halt ignore them."""
        self._plan.see(tips, standing)
        self._sensed = True

    @property
    def tips(self) -> np.ndarray:
        """Tips of the inner plan, (start, leg) [mm]."""
        return self._plan.tips

    @property
    def standing(self) -> np.ndarray:
        """Whether each leg stands in the inner plan, (start, leg)."""
        return self._plan.standing

    def _disturb(self, which: np.ndarray) -> None:
        """Disturb starts, mask (start,): set how long each rests, and the tips and states with which it continues."""
        tips, standing = self._disturbance.legs(self._plan.tips, self._plan.standing)
        self._tips[which], self._standing[which], self._held[which] = tips[which], standing[which], self._beside[which]
        self.resumed[which] = self.done
        steps = round(PAUSE / self.stride.dt)
        for start in np.flatnonzero(which & self._stops).tolist():
            way, stands = np.tile(tips[start], (steps, 1)), np.ones((steps, 6), dtype=bool)
            if self._postures:
                nearest = self._postures.nearest(tips[start])
                moved, moving = reorganise(tips[start], self._postures.tips[nearest], self.stride)
                way, stands = np.concatenate([way, moved]), np.concatenate([stands, moving])
                self._standing[start] = self._postures.standing[nearest]
            self._rests[start], self._tips[start] = (way, stands), way[-1]
            self.resumed[start] += len(way)

    def _resume(self, which: np.ndarray) -> None:
        """Let the inner plan of starts, mask (start,), continue, or restart if the disturbance made the body rest."""
        if not which.any():
            return
        if self._stops:
            self._plan.restart(which.copy(), self._tips.copy())
        if self._slows:
            self._plan.slow_down(which.copy())
        legs = which[:, None]
        self._plan.see(np.where(legs, self._tips, self._plan.tips), np.where(legs, self._standing, self._plan.standing))

    def _go_on(self, steps: int) -> PlannedWalk:
        """Plan a number of steps in which no start is disturbed or resumes; overwrite the steps of resting starts."""
        before = self.done
        walk = copied(self._plan.advance(steps))
        self.done, self._beside = self.done + steps, walk.y[-1].copy()
        for start, (way, stands) in self._rests.items():
            if before < self.resumed[start]:
                rows = slice(before - self._step[start], before - self._step[start] + steps)
                walk.velocity[:, start] = 0.0
                walk.x[:, start], walk.stance[:, start] = way[rows], stands[rows]
                walk.y[:, start], walk.height[:, start] = self._held[start], np.nan
                back = np.diff(way, axis=0, prepend=way[:1]) < 0.0  # a swing to the rear has no AEP
                walk.aep[:, start] = np.where(back[rows], np.nan, self.stride.aep0)
        return walk


class DisturbedFeedbackPlan(DisturbedPlan):
    """A disturbed plan with sensory feedback, a `protocol.FeedbackPlan`."""

    def sense(self, sensed: Sensed) -> None:
        """Pass the sensed tips and contacts to the inner plan."""
        self._sensed = True
        self._plan.sense(sensed)
