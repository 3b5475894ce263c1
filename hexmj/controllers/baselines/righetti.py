"""Hopf oscillators, one per leg, whose swings and stances end depending on the load: Righetti & Ijspeert.

Source: L. Righetti, A. J. Ijspeert, Pattern generators with sensory feedback for the control of quadruped locomotion,
ICRA 2008, pp. 819-824. The paper was not available; equations and constants are those of a public re-implementation
that cites it:
    dx_i/dt = alpha (mu - r_i^2) x_i - omega_i y_i                                 (1)
    dy_i/dt = beta (mu - r_i^2) y_i + omega_i x_i + sum_j k_ij y_j + u_i           (2)
    omega_i = omega_stance / (exp(-b y_i) + 1) + omega_swing / (exp(b y_i) + 1)    (3)
    u_i = -omega_i x_i - sum_j k_ij y_j  stops a transition, -sign(y_i) F hastens one, else 0    (4)
A leg stands while y > 0, where x falls, and swings while y < 0. That code has no load. From memory, we let Eq. 4 stop
the end of a stance while the foot is loaded, and hasten transitions otherwise.

Mapping: omega_stance = pi V_r / (AEP_0 - PEP_0) and omega_swing = pi V_p / (AEP_0 - PEP_0); the tip at time 0 sets x
and y; a leg is lifted when y becomes negative. Chosen by us, since the source is about quadrupeds and we did not find
its thresholds of load: a period lasts 1 s of the source's time; all legs are coupled, k_ij = 1 within a tripod and -1
between tripods, like the source's trot. At the end of a stance a leg waits while it carries more than a quarter of the
weight (a standing leg's share is a sixth of six legs, a third of three); at the end of a swing it waits while its foot
carries nothing. The second half of a stance is hastened if the foot carries nothing, that of a swing if the foot
carries a load.  Fitted: nothing.  Sensed: the load on each foot.

The resulting periods are 6 to 19 % shorter than (AEP_0 - PEP_0) (1 + 1/V), the period of a single leg.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, sum_of_legs
from hexmj.errors import Refused
from hexmj.starts import draw_starts
from hexmj.timing import Stride

TRIPOD = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""(leg,) sign of each leg's tripod; k_ij is `coupling` times the signs of legs i and j."""

N_TRIED, TRIED = 64, 400
"""Number of starts and steps of the test for divergence: when oscillators diverged, 8 starts showed it in 120 steps."""


class Hopf(NamedTuple):
    """State of the oscillators."""

    x: np.ndarray
    """(start, leg) x of Eq. 1: 1 at AEP_0, -1 at PEP_0."""
    y: np.ndarray
    """(start, leg) y of Eq. 2: positive in stance, negative in swing."""


@dataclass(frozen=True)
class Righetti(Lifted):
    """Six coupled oscillators with load feedback, Eqs. 1 to 4."""

    alpha: float = 5.0
    """alpha, rate at which x returns to the limit cycle [1/s]; from the source."""
    beta: float = 50.0
    """beta, rate at which y returns to the limit cycle [1/s]; from the source."""
    mu: float = 1.0
    """mu, square of the amplitude; from the source."""
    sharpness: float = 10.0
    """b, steepness of the change between omega_stance and omega_swing; from the source."""
    push: float = 300.0
    """F, by which Eq. 4 hastens a transition [1/s]; from the source."""
    coupling: float = 1.0
    """|k_ij|, strength of the coupling of two legs [1/s]; from the source."""
    near: float = 0.25
    """Maximum |y| / r at which a transition can be stopped; from the source."""
    loaded: float = 0.25
    """Share of the weight above which a leg does not begin a swing; chosen by us."""
    name: str = "righetti"

    reads_load = True
    mirrored = True

    def check_velocity(self, velocity: float, stride: Stride) -> None:
        """See `protocol.Controller`: walk `TRIED` steps from `N_TRIED` starts to find out if the time step is too long.

        Raises:
            Refused: the oscillators diverge within these steps, which may be more than the walk has.
        """
        starts = draw_starts(N_TRIED, 0, stride)
        self.begin(starts, np.full(N_TRIED, velocity), stride).advance(TRIED)

    def at_start(self, legs: Legs) -> Hopf:
        """See `Lifted.at_start`."""
        angle = np.pi * np.clip(legs.travel, 0.0, 1.0)
        return Hopf(np.cos(angle), np.sin(angle))

    def lifts(self, state: Hopf, legs: Legs) -> tuple[Hopf, np.ndarray]:
        """See `Lifted.lifts`.

        Raises:
            Refused: the oscillators diverge at this time step.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            after = self._step(state, legs)
        if not (known := np.isfinite(after.y).all(axis=1)).all():
            v = legs.v[np.argmin(known), 0]
            raise Refused(
                f"{self.name}: the oscillators diverge at dt = {legs.stride.dt:g} and V_r = {v:.3g}; expected a shorter"
                " time step"
            )
        return after, (state.y >= 0) & (after.y < 0)

    def _step(self, state: Hopf, legs: Legs) -> Hopf:
        x, y = state
        swing = np.pi * legs.stride.dt / (legs.stride.aep0 - legs.stride.pep0)  # omega_swing dt
        seconds = swing / np.pi * legs.v * legs.stance_part  # dt in seconds of the source, where a period lasts 1 s
        rise = 1.0 / (1.0 + np.exp(-self.sharpness * y))
        turn = swing * (legs.v * rise + (1.0 - rise))  # Eq. 3, omega dt
        back = (self.mu - (x * x + y * y)) * seconds
        others = self.coupling * seconds * (TRIPOD * sum_of_legs(TRIPOD * y)[:, None] - y)
        stop, hasten = self.feedback(state, legs.load)
        u = np.where(stop, -turn * x - others, np.where(hasten, -np.sign(y) * self.push * seconds, 0.0))  # Eq. 4
        return Hopf(
            x + self.alpha * back * x - turn * y,  # Eq. 1
            y + self.beta * back * y + turn * x + others + u,  # Eq. 2
        )

    def feedback(self, state: Hopf, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which transitions stop and which are hastened, both (start, leg); `load` is a share of the weight."""
        x, y = state
        close = np.abs(y) < self.near * np.sqrt(x * x + y * y)
        ends_stance, ends_swing = (y > 0) & (x < 0), (y < 0) & (x > 0)
        stop = close & (ends_stance & (load > self.loaded) | ends_swing & (load <= 0))
        return stop, ends_stance & (load <= 0) | ends_swing & (load > 0)
