"""Reorganising disturbed legs, the paper's first strategy (Section 6): to the nearest of a small set of postures.

The postures are those of undisturbed walking, each with the states of its legs.  Both must be taken over: positions
alone do not keep a walk stable (`docs/laboratory.md`).
"""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.checked_plans import begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.gaits import limit_gait
from hexmj.stability import stability_margin, walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride

POSTURES = 36
"""Postures collected over one period."""
CANDIDATES = 20
"""Random starts of which the first that reaches a stable limit regime gives the postures."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures of undisturbed walking."""

    tips: np.ndarray
    """(posture, leg) [mm]."""
    standing: np.ndarray
    """(posture, leg) which legs retract."""

    def nearest(self, tips: np.ndarray) -> int:
        """The posture with the least Euclidean distance over the six tips, (leg,) [mm]."""
        return int(np.argmin(((self.tips - tips) ** 2).sum(axis=1)))


@dataclass(frozen=True, eq=False)
class Rest:
    """Steps for which the body stands still."""

    tips: np.ndarray
    """(step, leg) after each step [mm]."""
    standing: np.ndarray
    """(step, leg)."""

    @property
    def moves_back(self) -> np.ndarray:
        """(step, leg) which tips move to the rear in each step; nothing tells where that swing will end."""
        return np.diff(self.tips, axis=0, prepend=self.tips[:1]) < 0.0


def collect_postures(controller: Controller, velocity: float, seed: int, stride: Stride) -> Postures:
    """Statically stable postures, evenly spread over one period of a limit regime at this velocity.

    Raises:
        InputError: no start reaches a stable periodic regime.
    """
    gait = limit_gait(controller, velocity, n_starts=CANDIDATES, seed=seed, stride=stride)
    stable = gait.periodic & gait.stable
    if not stable.any():
        raise InputError(
            f"reorganise at V = {velocity:g}: none of {CANDIDATES} starts reaches a periodic, statically stable gait;"
            " expected a controller and a velocity with one, or other strategies"
        )
    one = int(np.argmax(stable))
    plan = begin(controller, draw_starts(CANDIDATES, seed, stride)[one : one + 1], velocity, stride)
    plan.advance(round(gait.reached[one] / stride.dt))
    walk = plan.advance(round(gait.period[one] / stride.dt))
    rows = np.linspace(0, len(walk.time), POSTURES, endpoint=False).astype(int)
    rows = rows[walk_margin(walk)[rows, 0] > 0]
    return Postures(walk.x[rows, 0], walk.stance[rows, 0])


def stand(tips: np.ndarray, steps: int) -> Rest:
    """All legs stand at `tips`, (leg,) [mm]."""
    return Rest(np.tile(tips, (steps, 1)), np.ones((steps, 6), dtype=bool))


def reorganise(tips: np.ndarray, goal: np.ndarray, stride: Stride) -> Rest:
    """Lift one leg after the other and put it down at its goal, both (leg,) [mm], at V_p.

    The next leg is always the one without which the others support the body best.  Legs nearer to their goal than
    one step's way stay where they are.
    """
    now, left = tips.copy(), [int(leg) for leg in np.flatnonzero(np.abs(goal - tips) > stride.dt)]
    rows, states = [], []
    while left:
        leg = max(left, key=lambda one: _margin_without(one, now, stride))
        left.remove(leg)
        way = goal[leg] - now[leg]
        for n in range(int(np.ceil(abs(way) / stride.dt)) - 1, -1, -1):
            now[leg] = goal[leg] - np.sign(way) * n * stride.dt
            rows.append(now.copy())
            states.append((np.arange(6) != leg) | (n == 0))
    return Rest(np.array(rows).reshape(-1, 6), np.array(states, dtype=bool).reshape(-1, 6))


def _margin_without(leg: int, tips: np.ndarray, stride: Stride) -> float:
    """The stability margin while one leg is up [mm]."""
    geometry = stride.geometry
    feet = np.stack([tips + np.array(geometry.origin), np.array(geometry.y)], axis=-1)
    return float(stability_margin(feet, np.arange(6) != leg, threads=1))
