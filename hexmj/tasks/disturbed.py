"""Plans with a disturbance (paper, Section 6), and the reorganisation of legs, the paper's first strategy.

The paper describes an obstacle as "the termination of motion. Then the motion is initiated from new leg positions".
Reorganisation moves the legs to the nearest of a few postures of undisturbed walking. The legs also continue with the
states, swing or stance, of that posture, since tip positions alone do not keep the walk stable.
"""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from hexmj.command import Command
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller, FeedbackPlan, Sensed, SteerableController, SteerablePlan
from hexmj.controllers.wrappers import WrappedSteerablePlan
from hexmj.errors import InputError
from hexmj.gaits import steady_state_gait
from hexmj.measures.kinematic import first_loss
from hexmj.stability import stability_margin, walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, copied, joined

NEVER = 2**62
"""Step number that stands for an event that has not happened yet."""

SETTLED = 3
"""Number of periods of a single leg before the period in which the disturbance occurs."""

MOST_DRAWN = 200_000
"""Maximum number of starts drawn to find starts whose plan is stable until the disturbance."""

POSTURES = 36
"""Number of postures collected over one period; unstable postures are then dropped."""

CANDIDATES = 20
"""Number of random starts walked to collect postures from the first that reaches a stable steady-state gait."""

PAUSE = 4.0
"""Time for which a halted body stands [time units]. Up to V_p = 200 mm/s it exceeds the 20 ms of lowering a foot."""


class TooFewStable(InputError):
    """Raised if too few random starts keep static stability until the disturbance."""


@dataclass(frozen=True, eq=False)
class TimedStarts:
    """The starts of walks, and when each is disturbed."""

    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    step: np.ndarray
    """(start,) number of steps before the disturbance."""
    draw: np.ndarray
    """(start,) random number in [0, 1) that chooses which of the swinging legs is stopped."""
    drawn: int
    """Number of random starts drawn until these were found."""


def find_stable_starts(
    controller: Controller,
    velocity: float,
    n_starts: int,
    seed: int,
    stride: Stride,
    grid: int,
    command: Command | None = None,
) -> TimedStarts:
    """Return the first `n_starts` random starts of a seed whose plan is stable until the disturbance.

    The disturbance occurs at a random multiple of `grid` steps, uniform within the period of a single leg that follows
    the first `SETTLED` periods.

    Args:
        controller: controller that plans the walks.
        velocity: V_r of the walks, which gives the period of a leg.
        n_starts: number of starts.
        seed: seed of the starts and of the times.
        stride: step range, lines of the tips and time step.
        grid: number of steps, see above.
        command: command of the walks; by default they are straight at `velocity`.

    Raises:
        TooFewStable: fewer than `n_starts` of `MOST_DRAWN` starts are stable until the disturbance.
    """
    period, drawn, walks = stride.periods(velocity) / stride.dt, 0, command or velocity
    while drawn < MOST_DRAWN >= n_starts:
        drawn = min(max(2 * drawn, n_starts), MOST_DRAWN)
        starts = draw_starts(drawn, seed, stride)
        when, draw = np.random.default_rng([seed, 2]).uniform(size=(drawn, 2)).T
        step = grid * np.ceil((SETTLED + when) * period / grid).astype(int)
        found = np.flatnonzero(np.isinf(first_loss(starts, controller, walks, step * stride.dt, stride=stride)))
        if len(found) >= n_starts:
            found = found[:n_starts]
            return TimedStarts(starts[found], step[found], draw[found], int(found[-1]) + 1)
    raise TooFewStable(
        f"fewer than n_starts = {n_starts} of {MOST_DRAWN} starts are stable until the disturbance at V = {velocity:g}"
    )


@dataclass(frozen=True, eq=False)
class Disturbance:
    """One disturbance of the same kind in the walk of every start."""

    kind: Literal["halt", "leg", "push"]
    """All legs halt; one swinging leg is stopped, so that its stance begins where it is; or a push on the body, which
    leaves the legs as they are."""
    step: np.ndarray
    """(start,) number of steps of the plan before the disturbance; kind 'leg' then waits until a leg swings."""
    draw: np.ndarray
    """(start,) random number in [0, 1) that chooses which of the swinging legs is stopped."""
    leg: int | None = None
    """Index of the leg that is stopped; None for a random one."""

    def swinging(self, standing: np.ndarray) -> np.ndarray:
        """Return the legs that can be stopped, (start, leg), given which legs stand, (start, leg)."""
        return ~standing if self.leg is None else ~standing & (np.arange(6) == self.leg)

    def awaited(self, standing: np.ndarray) -> np.ndarray:
        """Return whether each start must wait for a swinging leg, (start,), given which legs stand, (start, leg)."""
        return np.logical_and(self.kind == "leg", ~self.swinging(standing).any(axis=1))

    def stands_after(self, standing: np.ndarray) -> np.ndarray:
        """Return which legs stand after a disturbance at this moment, (start, leg)."""
        if self.kind != "leg":
            return np.logical_or(standing, self.kind == "halt")
        legs = self.swinging(standing)
        nth = np.floor(self.draw * legs.sum(axis=1)).astype(int)
        return standing | (legs & (np.cumsum(legs, axis=1) == nth[:, None] + 1))


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
    `slows`, the walk continues at V_r(0) and accelerates to V_r by Eq. 11.
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


class DisturbedPlan(WrappedSteerablePlan):
    """The plan that a `Disturbed` controller begins: a `protocol.SteerablePlan` with a disturbance."""

    def __init__(self, controller: Disturbed, plan: SteerablePlan) -> None:
        """Wrap a plan that is at time 0."""
        super().__init__(plan)
        self._disturbance, self._postures, self._slows = controller.disturbance, controller.postures, controller.slows
        self.step = self._disturbance.step.copy()
        """(start,) number of steps before the disturbance; it grows while a start waits for a swinging leg."""
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
            now = self.step == self.done
            awaited = now & self._disturbance.awaited(self._plan.standing)
            self.step[awaited] += 1
            self._disturb(now & ~awaited)
            self._resume(self.resumed == self.done)
            coming = np.concatenate([self.step, self.resumed, [end]])
            parts.append(self._go_on(int(coming[coming > self.done].min()) - self.done))
        return joined(parts)

    def _disturb(self, which: np.ndarray) -> None:
        """Disturb starts, mask (start,): set how long each rests, and the tips and states with which it continues."""
        tips, standing = self._plan.tips, self._disturbance.stands_after(self._plan.standing)
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
                rows = slice(before - self.step[start], before - self.step[start] + steps)
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
        self._plan.sense(sensed)
