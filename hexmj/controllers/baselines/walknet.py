"""Walknet: legs that shift each other's PEP by the rules of Cruse (1990), with the constants of two published versions.

A leg is lifted when x < PEP_i. PEP_i is PEP_0 plus the shifts that its neighbours send, at least `least_step` behind
AEP_0.  Rule 1: while a leg swings, and for a time after its touchdown, its neighbours swing later.  Rule 2: in an
interval after a leg's touchdown, its neighbours swing earlier.  Rule 3: while a standing leg is within a part of its
stance, its neighbours swing earlier.  Rule 5: the more weight a leg carries, the later its neighbours swing.

Only equations and constants come from the sources: `CURVE` from github.com/jsimmering/walknet-curvewalking
(single_leg_controller.py, SingleLeg.py, RobotSettings.py), with the PEP as a line across the body axis as in the
original Walknet; `REACOG` from github.com/malteschilling/cognitiveWalker (WalknetSettings.py, CoordinationRules.py);
the weights of rule 5, which both lack, from github.com/hcruse/neuro_walknet (NeuroWNSettings.py).

Mapping: the step length is AEP_0 - PEP_0, the swing velocity V_p. The source's velocity is v = V * `swing_speed`, and
a second is the duration of a swing over `swing_speed` / `step_length` step lengths. Sensed: the own tip; the tip,
the state and (for rule 5) the load of the neighbours.  All legs are updated at once; the code of `CURVE` updates one
leg after the other.

Chosen by us, since the sources do not say: the `swing_speed` of `CURVE`, and how rule 5 shifts PEP, see `sent_load`.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.errors import InputError
from hexmj.legs import MIRROR, N2, N4

OfPairs = tuple[float, float, float]
"""Values for the front, middle and hind legs, the same for left and right."""


@dataclass(frozen=True)
class Links:
    """Shifts of PEP for front, middle and hind receivers [step lengths]; above 0 the swing begins earlier."""

    behind: OfPairs = (0.0, 0.0, 0.0)
    """Shifts sent by the ipsilateral leg behind."""
    ahead: OfPairs = (0.0, 0.0, 0.0)
    """Shifts sent by the ipsilateral leg ahead."""
    across: OfPairs = (0.0, 0.0, 0.0)
    """Shifts sent by the contralateral leg."""

    def shift(self, sent: np.ndarray) -> np.ndarray:
        """Return each leg's shift, (start, leg) [step lengths]; `sent` is the strength of each sender, at most 1."""
        behind, ahead, across = (np.array(2 * values) for values in (self.behind, self.ahead, self.across))
        return from_neighbour(N2, sent) * behind + from_neighbour(N4, sent) * ahead + sent[:, MIRROR] * across


@dataclass(frozen=True)
class Lines:
    """A piecewise linear function of the velocity, constant beyond its first and last knot."""

    v: tuple[float, ...]
    """Velocities of the knots [m/s]."""
    value: tuple[float, ...]
    """Values at the knots."""

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return the value at v [m/s]."""
        return np.interp(v, self.v, self.value)


@dataclass(frozen=True)
class Logistic:
    """The logistic function 1 / (1 + exp(steepness (v - middle))) of the velocity v."""

    steepness: float
    """Steepness [s/m]."""
    middle: float
    """Velocity at which the value is 1/2 [m/s]."""

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return the value at v [m/s]."""
        return 1.0 / (1.0 + np.exp(self.steepness * (v - self.middle)))


@dataclass(frozen=True)
class Constants:
    """The constants of a published Walknet; the sender is the leg that acts on the PEP of a neighbour."""

    step_length: float
    """Distance from PEP to AEP without influences [m]."""
    swing_speed: float
    """Speed of a foot in swing [m/s]."""
    rule1: Links
    """Rule 1: shifts of PEP while the sender swings."""
    rule1_rest: float
    """Fraction of the shifts of rule 1 that stays for `rule1_delay` after the sender's touchdown."""
    rule1_delay: Lines
    """Time after the sender's touchdown in which rule 1 still acts [s]."""
    rule2: Links
    """Rule 2: shifts of PEP in `rule2_window`."""
    rule2_window: tuple[float, float]
    """Begin and end of rule 2, after the sender's touchdown [s]."""
    rule3_along: Links
    """Rule 3: shifts of the ipsilateral neighbours' PEP while the sender stands in a part of its stance."""
    rule3_along_from: Lines | Logistic
    """Begin of this part: distance behind the sender's AEP [step lengths]."""
    rule3_along_for: float
    """Length of this part [step lengths]."""
    rule3_across: Links
    """Rule 3: shifts of the contralateral leg's PEP while the sender stands in another part of its stance."""
    rule3_across_from: Lines
    """Begin of that part: distance behind the sender's AEP [step lengths]."""
    rule3_across_for: float
    """Length of that part [step lengths]."""
    least_step: float
    """Minimum distance of every shifted PEP behind AEP [step lengths]."""


CURVE = Constants(
    step_length=0.08,
    swing_speed=0.142,
    rule1=Links(behind=(-0.7, -0.7, 0.0), across=(0.0, 0.0, -0.7)),
    rule1_rest=0.2 / 0.7,
    rule1_delay=Lines((0.07, 0.107, 0.142), (0.27, 0.2, 0.0)),
    rule2=Links(behind=(0.5375, 0.5375, 0.0), across=(0.1375, 0.1375, 0.1375)),
    rule2_window=(0.27, 0.32),
    rule3_along=Links(ahead=(0.0, 0.4, 0.4)),
    rule3_along_from=Logistic(50.0, 0.085),
    rule3_along_for=0.008 / 0.08,
    rule3_across=Links(across=(0.3125, 0.0, 0.375)),
    rule3_across_from=Lines((0.0, 0.2), (0.5, 0.5 - 1.5 * 0.2)),
    rule3_across_for=0.008 / 0.08,
    least_step=1.0 / 6.0,
)
"""Constants of walknet-curvewalking.

Its feet lag behind a target that moves 1.2 m/s / 50 Hz ahead of them; the duration of a swing is not published.  We use
as `swing_speed` the speed at which the delay of rule 1 becomes 0, the highest speed in its rules.
"""

M = 1.0 / 0.16
"""Step lengths of `REACOG` per metre."""

REACOG = Constants(
    step_length=0.16,
    swing_speed=0.151,
    rule1=Links(
        behind=(-0.2 * M, -0.2 * M, 0.0), ahead=(0.0, -0.065 * M, -0.13 * M), across=(-0.13 * M, 0.0, -0.13 * M)
    ),
    rule1_rest=0.25,
    rule1_delay=Lines((0.0, 0.03, 0.03 + 0.2 / 18), (0.2 + 6 * 0.03, 0.2, 0.0)),
    rule2=Links(behind=(0.08 * M, 0.08 * M, 0.0), across=(0.02 * M, 0.02 * M, 0.02 * M)),
    rule2_window=(0.37, 0.42),
    rule3_along=Links(ahead=(0.0, 0.045 * M, 0.06 * M)),
    rule3_along_from=Lines((0.0, 0.01, 0.01, 0.2), (1 - 0.079, 1 - 0.119, 1 - 0.256, 1 - 0.636)),
    rule3_along_for=0.05 * M,
    rule3_across=Links(across=(0.1 * M, 0.0, 0.1 / 3 * M)),
    rule3_across_from=Lines((0.0, 0.2), (1 - 0.5, 1 - 0.5 - 6 * 0.2)),
    rule3_across_for=0.03 * M,
    least_step=0.05 * M,
)
"""Constants of reaCog, which has no rule 5; its rule 1 acts on hind legs too.

The part of rule 3 begins 0.236 + 2 v (0.079 + 4 v up to 0.01 m/s), or contralaterally 0.5 + 6 v, of the step length
ahead of PEP, and extends to the rear.  A swing of 0.16 m, over its highest point, takes 0.296 m / (0.28 m/s).
"""

RULE5 = Links(behind=(-0.2, -0.2, 0.0), ahead=(0.0, -0.2, -0.2), across=(-0.1, -0.1, 0.0))
"""Shifts of rule 5: R5i and R5c of neuro_walknet; R5ch, between hind legs, is left out: it acts only in swing."""


def sent_load(load: np.ndarray) -> np.ndarray:
    """Return the strength, 0 to 0.6, with which a leg that carries a share `load` of the weight acts by rule 5.

    In neuro_walknet the effort of the leg's retractor, 0 to 50 mV, minus a threshold of 20 mV, strengthens the
    retractors of standing neighbours.  Here a third of the weight, a leg's share in a tripod, equals an effort of
    50 mV, and the effect prolongs the neighbour's stance: 50 mV times a weight of 1 equals one step length.
    """
    return np.maximum(np.minimum(3.0 * load, 1.0) - 20.0 / 50.0, 0.0)


@dataclass(frozen=True)
class Walknet(Lifted):
    """Legs that shift each other's PEP by the rules 1, 2, 3 and 5."""

    name: str = "walknet"
    constants: Constants = CURVE
    rules: tuple[int, ...] = (1, 2, 3)
    """Rules that act, some of 1, 2, 3 and 5."""

    mirrored = True

    def __post_init__(self) -> None:
        if not set(self.rules) <= {1, 2, 3, 5}:
            raise InputError(f"rules = {self.rules}; expected some of 1, 2, 3 and 5")

    @property
    def reads_load(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether rule 5 acts, the only rule that uses the load."""
        return 5 in self.rules

    def without(self, rule: int) -> "Walknet":
        """Return the controller without a rule; its name ends with ``-without-N``.

        Raises:
            InputError: the controller does not have this rule.
        """
        if rule not in self.rules:
            raise InputError(f"{self.name} has no rule {rule}; expected one of {', '.join(map(str, self.rules))}")
        return replace(self, name=f"{self.name}-without-{rule}", rules=tuple(r for r in self.rules if r != rule))

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted.at_start`: time since touchdown, (start, leg) [time units]; infinite before the first one."""
        return np.full(legs.x.shape, np.inf)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted.lifts`."""
        dt, span = legs.stride.dt, legs.stride.aep0 - legs.stride.pep0
        age = np.where(legs.stands, state + dt, -dt)  # time in stance: 0 at the step of touchdown
        shift = sum((self.shift(rule, legs, age) for rule in self.rules), np.zeros(legs.x.shape))
        pep = np.minimum(legs.stride.pep0 + span * shift, legs.stride.aep0 - span * self.constants.least_step)
        return age, legs.stands & (legs.x < pep)

    def shift(self, rule: int, legs: Legs, age: np.ndarray) -> np.ndarray:
        """Return the shift of each leg's PEP by a rule, (start, leg) [step lengths]; `age` is the time in stance."""
        own, v = self.constants, legs.v * self.constants.swing_speed
        second = own.swing_speed / own.step_length * (legs.stride.aep0 - legs.stride.pep0)  # [time units]
        match rule:
            case 1:
                resting = (age >= 0) & (age < own.rule1_delay.at(v) * second)
                return own.rule1.shift(np.where(legs.stands, own.rule1_rest * resting, 1.0))
            case 2:
                begin, end = own.rule2_window
                return own.rule2.shift((age >= begin * second) & (age < end * second))
            case 3:
                along = _within(legs, own.rule3_along_from.at(v), own.rule3_along_for)
                across = _within(legs, own.rule3_across_from.at(v), own.rule3_across_for)
                return own.rule3_along.shift(along) + own.rule3_across.shift(across)
            case _:
                return RULE5.shift(sent_load(legs.load))


def _within(legs: Legs, begin: np.ndarray, length: float) -> np.ndarray:
    """Return which legs stand in a part of the stance, (start, leg), given its begin behind AEP_0 and its length."""
    return legs.stands & (legs.travel > begin) & (legs.travel < begin + length)
