"""Walknet: six leg controllers that shift each other's PEP (rules of Cruse 1990), in two published versions.

A leg is lifted when x < PEP_i, PEP_i = PEP_0 + the sum of what its neighbours send it, and at least `least_step` behind
AEP_0.  Rule 1: while a leg swings, and for a while after its touchdown, its neighbours swing later.  Rule 2: some time
after its touchdown they swing earlier.  Rule 3: so do they while it passes a stretch of its own stance.  Rule 5: the
more weight a leg carries, the later its neighbours swing.

Sources, of which only equations and constants are taken: `CURVE` is github.com/jsimmering/walknet-curvewalking
(single_leg_controller.py, SingleLeg.py, RobotSettings.py), with its PEP a line across the body's axis as in the
original Walknet; `REACOG` is github.com/malteschilling/cognitiveWalker (WalknetSettings.py, CoordinationRules.py);
rule 5's weights are those of github.com/hcruse/neuro_walknet (NeuroWNSettings.py), since neither of the two has it.

Mapping: the step length is AEP_0 - PEP_0, the swing velocity V_p; so v = V * `swing_speed`, and a second is as
long as a swing of `swing_speed` / `step_length` step lengths.  Sensed: the own tip, and of the neighbours the tip,
whether they swing, and for rule 5 their load.  Every leg acts on what all did at the same step; `CURVE` asks its legs
one after the other.

Chosen by us, since the sources do not say: the `swing_speed` of `CURVE`, and how rule 5 shifts PEP, see `sent_load`.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.errors import InputError
from hexmj.legs import MIRROR, N2, N4

OfPairs = tuple[float, float, float]
"""Values for front, middle and hind legs, left and right alike."""


@dataclass(frozen=True)
class Links:
    """Shifts of PEP by the receiver's place [step lengths]; above 0 its swing begins earlier."""

    behind: OfPairs = (0.0, 0.0, 0.0)
    """From the ipsilateral leg behind."""
    ahead: OfPairs = (0.0, 0.0, 0.0)
    """From the ipsilateral leg ahead."""
    across: OfPairs = (0.0, 0.0, 0.0)
    """From the contralateral leg."""

    def shift(self, sent: np.ndarray) -> np.ndarray:
        """Return each leg's shift, (start, leg) [step lengths], by `sent`, (start, leg), at most 1."""
        behind, ahead, across = (np.array(2 * values) for values in (self.behind, self.ahead, self.across))
        return from_neighbour(N2, sent) * behind + from_neighbour(N4, sent) * ahead + sent[:, MIRROR] * across


@dataclass(frozen=True)
class Lines:
    """A value that depends on the velocity, straight between knots and level beyond them."""

    v: tuple[float, ...]
    """Of the knots [m/s]."""
    value: tuple[float, ...]
    """At the knots."""

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return the value at v [m/s]."""
        return np.interp(v, self.v, self.value)


@dataclass(frozen=True)
class Logistic:
    """1 / (1 + exp(steepness (v - middle)))."""

    steepness: float
    """[s/m]."""
    middle: float
    """[m/s]."""

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return the value at v [m/s]."""
        return 1.0 / (1.0 + np.exp(self.steepness * (v - self.middle)))


@dataclass(frozen=True)
class Constants:
    """The constants of a published Walknet."""

    step_length: float
    """AEP - PEP without influences [m]."""
    swing_speed: float
    """At which a foot goes ahead in swing [m/s]."""
    rule1: Links
    """While the sender swings."""
    rule1_rest: float
    """Part of rule 1 that lasts after the sender's touchdown ..."""
    rule1_delay: Lines
    """... and for how long [s]."""
    rule2: Links
    """Some time after the sender's touchdown."""
    rule2_window: tuple[float, float]
    """From when until when [s]."""
    rule3_along: Links
    """Ipsilateral, while the sender stands within a stretch ..."""
    rule3_along_from: Lines | Logistic
    """... that begins so far behind its AEP ..."""
    rule3_along_for: float
    """... and is so long, both [step lengths]."""
    rule3_across: Links
    """Contralateral, the same ..."""
    rule3_across_from: Lines
    """... from here ..."""
    rule3_across_for: float
    """... on for so long, both [step lengths]."""
    least_step: float
    """How far behind AEP every PEP stays [step lengths]."""


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
"""walknet-curvewalking.

Its feet lag behind a target that keeps 1.2 m/s / 50 Hz ahead of them, and how long a swing takes is not printed.  Taken
is the speed at which rule 1 has no delay left, the fastest that its rules know.
"""

M = 1.0 / 0.16
"""A metre in step lengths of `REACOG`."""

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
"""reaCog.  Having no rule 5, it lets rule 1 act on hind legs too.

A stretch of rule 3 begins 0.236 + 2 v (0.079 + 4 v up to 0.01 m/s) or 0.5 + 6 v of the way ahead of PEP, and goes to
the rear.  A foot takes 0.296 m / (0.28 m/s) from PEP over the highest point to AEP, 0.16 m ahead.
"""

RULE5 = Links(behind=(-0.2, -0.2, 0.0), ahead=(0.0, -0.2, -0.2), across=(-0.1, -0.1, 0.0))
"""R5i and R5c of neuro_walknet; R5ch, between hind legs, acts on swinging legs only."""


def sent_load(load: np.ndarray) -> np.ndarray:
    """Return what a leg sends by rule 5, 0 to 0.6, when it carries a fraction `load` of the weight.

    In neuro_walknet the effort of the leg's retractor, 0 to 50 mV, less a threshold of 20 mV, strengthens the
    retractors of its neighbours that stand.  Here a third of the weight, a leg's part in a tripod, is an effort of
    50 mV, and the neighbour's stance is prolonged: 50 mV times a weight of 1 are a step length.
    """
    return np.maximum(np.minimum(3.0 * load, 1.0) - 20.0 / 50.0, 0.0)


@dataclass(frozen=True)
class Walknet(Lifted):
    """Legs that shift each other's PEP."""

    name: str = "walknet"
    constants: Constants = CURVE
    rules: tuple[int, ...] = (1, 2, 3)
    """Rules that act, of 1, 2, 3 and 5."""
    veto: bool = False
    """Whether no leg is lifted while three or more swing, as in `CURVE`; several may be lifted in one step."""

    mirrored = True

    def __post_init__(self) -> None:
        if not set(self.rules) <= {1, 2, 3, 5}:
            raise InputError(f"rules = {self.rules}; expected some of 1, 2, 3 and 5")

    @property
    def reads_load(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Rule 5 does."""
        return 5 in self.rules

    def without(self, rule: int) -> "Walknet":
        """Return the controller without a rule, with a name that says so.

        Raises:
            InputError: the rule does not act.
        """
        if rule not in self.rules:
            raise InputError(f"{self.name} without rule {rule}; expected one of {', '.join(map(str, self.rules))}")
        return replace(self, name=f"{self.name}-without-{rule}", rules=tuple(r for r in self.rules if r != rule))

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted`: times since touchdown, (start, leg) [time units]; infinite where there was none."""
        return np.full(legs.x.shape, np.inf)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted`."""
        dt, span = legs.stride.dt, legs.stride.aep0 - legs.stride.pep0
        age = np.where(legs.stands, state + dt, -dt)  # 0 at the step of touchdown
        shift = sum((self.shift(rule, legs, age) for rule in self.rules), np.zeros(legs.x.shape))
        pep = np.minimum(legs.stride.pep0 + span * shift, legs.stride.aep0 - span * self.constants.least_step)
        lifted = legs.stands & (legs.x < pep)
        if self.veto:
            lifted &= (~legs.stands).sum(axis=1, keepdims=True) < 3
        return age, lifted

    def shift(self, rule: int, legs: Legs, age: np.ndarray) -> np.ndarray:
        """Return the shift of each leg's PEP by a rule, (start, leg) [step lengths]; `age` is that of the stances."""
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
    """Return which legs stand in a stretch of the stance, by its begin behind AEP_0 and length, (start, leg)."""
    return legs.stands & (legs.travel > begin) & (legs.travel < begin + length)
