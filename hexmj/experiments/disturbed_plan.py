"""A plan that meets a disturbance: the network until then, what becomes of it, and the network again."""

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.experiments.disturbance import NEVER, Disturbance
from hexmj.experiments.strategies import Postures, Rest, reorganise, stand
from hexmj.network import NetworkRun
from hexmj.parameters import Acceleration, Model, Network
from hexmj.walks import Walk, joined

PAUSE = 4.0
"""Time for which a halted body stands before anything else happens [time units]; 50 ms at V_p = 80 mm/s, two and
a half times what it takes to lower a foot.  It changes no planned loss."""


class DisturbedPlan:
    """A `plans.SeeingPlan`: the network's walk with one disturbance of every start, and a strategy against it.

    Without a strategy a halted body stands for `PAUSE`, then the network starts from there; any other goes on at once.
    With postures it is halted too, reorganises its legs and goes on from the posture, its states included.  With an
    acceleration it goes on with V_r(0), and Eq. 11 brings it back to V.
    """

    def __init__(
        self,
        starts: ArrayLike,
        model: Model,
        velocity: float,
        disturbance: Disturbance,
        *,
        postures: Postures | None = None,
        acceleration: Acceleration | None = None,
        network: Network | None = None,
        threads: int | None = None,
    ) -> None:
        """Put every start at time 0.

        Args:
            starts: tips, all standing, (start, leg) [mm].
            model: coupling weights.
            velocity: V_r before the disturbance and, after an acceleration, again.
            disturbance: of these starts.
            postures: reorganise the legs to the nearest of these.
            acceleration: slow down to its V_r(0).
            network: the constants that the paper leaves out.
            threads: one per core unless given; the result does not depend on it.

        Raises:
            InputError: starts, a velocity or a disturbance that do not fit.
        """
        self._run = NetworkRun(
            starts, model, velocity, network=network, acceleration=acceleration, at_speed=True, threads=threads
        )
        self.network, self.done = self._run.network, 0
        shape = self._run.tips.shape
        if disturbance.step.shape != shape[:1]:
            raise InputError(f"a disturbance of {len(disturbance.step)} starts; expected one of {shape[0]}")
        self._disturbance, self._postures, self._slows = disturbance, postures, acceleration is not None
        self._stops = disturbance.kind == "halt" or postures is not None
        self._rests: dict[int, Rest] = {}
        self._tips, self._standing = np.empty(shape), np.empty(shape, dtype=bool)
        self.resumed = np.full(shape[0], NEVER)
        """(start,) steps before the network goes on again, known as soon as the start has been disturbed."""

    def advance(self, steps: int) -> Walk:
        """The next `steps` steps; they do not depend on how the walk is divided into calls."""
        end, parts = self.done + steps, []
        while self.done < end:
            self._disturb(self._disturbance.step == self.done)
            self._resume(self.resumed == self.done)
            coming = np.concatenate([self._disturbance.step, self.resumed, [end]])
            parts.append(self._go_on(int(coming[coming > self.done].min()) - self.done))
        return joined(parts)

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Go on from these tips [mm] and states, both (start, leg); a start that rests keeps to its rest."""
        self._run.see(tips, standing)

    def _disturb(self, which: np.ndarray) -> None:
        """Let it happen to these starts, (start,): how long they rest, and the legs with which they go on."""
        tips, standing = self._disturbance.legs(self._run.tips, self._run.standing)
        self._tips[which], self._standing[which] = tips[which], standing[which]
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
        pause = stand(tips, round(PAUSE / self.network.dt))
        if not self._postures:
            return pause
        moves = reorganise(tips, self._postures.tips[self._postures.nearest(tips)], self.network)
        return Rest(np.concatenate([pause.tips, moves.tips]), np.concatenate([pause.standing, moves.standing]))

    def _resume(self, which: np.ndarray) -> None:
        """Let the network of these starts, (start,), go on, or start again after a rest."""
        if not which.any():
            return
        if self._stops:
            self._run.restart(which, self._tips)
        if self._slows:
            self._run.slow_down(which)
        legs = which[:, None]
        self._run.see(np.where(legs, self._tips, self._run.tips), np.where(legs, self._standing, self._run.standing))

    def _go_on(self, steps: int) -> Walk:
        """Steps in which nothing new happens; what the network plans for a start that rests is not used."""
        before = self.done
        walk = self._run.advance(steps)
        self.done += steps
        for start, rest in self._rests.items():
            if before < self.resumed[start]:
                rows = slice(before - self._disturbance.step[start], before - self._disturbance.step[start] + steps)
                walk.velocity[:, start] = 0.0
                walk.x[:, start], walk.stance[:, start] = rest.tips[rows], rest.standing[rows]
        return walk
