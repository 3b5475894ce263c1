"""The conditions of a physical walk, by idea: time scale, path of the feet, masses, contact, ground, numerics.

Names of fields are unique over all parts, so that on the command line, in recordings and in `Conditions.of` each stands
by itself.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

from hexmj.bodies.description import Body
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.checks import check_types, whole
from hexmj.errors import InputError
from hexmj.timing import Stride

GroundKind = Literal["flat", "step", "gap", "hurdle", "rough"]
"""Kinds of ground, see `Ground.ground`."""

OBEYED: dict[GroundKind, tuple[str, ...]] = {
    "flat": (),
    "step": ("ground_height", "ground_at"),
    "gap": ("ground_at", "ground_length"),
    "hurdle": ("ground_height", "ground_at", "ground_length"),
    "rough": ("ground_height", "ground_at", "ground_seed"),
}
"""Kind of ground -> the fields of `Ground` that it obeys."""

ROUNDING = 1e-9
"""Share by which physics steps may be longer than what they are to fit into, for the last bits of divisions."""


@dataclass(frozen=True)
class Bound:
    """What a condition may be."""

    least: float
    most: float
    unit: str
    """And what else there is to say of the greatest value."""
    closed: bool = False
    """Whether the least value is allowed, too."""

    def check(self, name: str, value: float) -> None:
        """Refuse a value that is not allowed."""
        if not (self.least <= value if self.closed else self.least < value) or not value <= self.most:
            low = f"{self.least:g} to" if self.closed else f"above {self.least:g} and at most"
            raise InputError(f"{name} = {value}; expected {low} {self.most:g} {self.unit}".rstrip())


@dataclass(frozen=True)
class TimeScale:
    """What links the plan's time to seconds."""

    vp: float = 80.0
    """Velocity V_p of a protracting tip relative to the body [mm/s]; links the plan's time unit, 1 mm / V_p,
    to seconds."""

    __post_init__ = check_types

    def seconds(self, stride: Stride) -> float:
        """Duration of one step of a plan [s]."""
        return stride.dt / self.vp


@dataclass(frozen=True)
class FootPath:
    """How feet are lifted and lowered where the plan leaves it to the body."""

    step_height: float = 12.0
    """Height to which a swinging foot is lifted [mm]; above the trunk's clearance, or the foot catches a falling
    body."""
    standing_height: float = 10.0
    """Height of the root above the standing tips [mm]."""
    lift_time: float = 20.0
    """Time in which a foot is raised [ms]; much shorter ones make feet hop that stand."""
    landing_time: float = 20.0
    """Time in which a foot is lowered, from before its AEP [ms]; shorter ones let it strike the ground."""

    __post_init__ = check_types

    def landing_distance(self, time: TimeScale) -> float:
        """How far before its AEP a tip begins to be lowered [mm]."""
        return time.vp * self.landing_time / 1000.0


@dataclass(frozen=True)
class Masses:
    """What is heavy, and where."""

    load: float = 0.0
    """Weight carried at O, in multiples of the insect's own."""
    centre_of_mass: float = 0.0
    """How far ahead of O the centre of mass, that of a load included, lies when all legs are at home [mm]; the
    animal's is at -9.4, 1.4 mm behind the hind coxae.  The trunk's masses are moved, none is added."""
    leg_mass: float = 1.0
    """Mass of the legs as a fraction of the insect's own; the trunk makes up for it.  The paper's legs have none."""

    __post_init__ = check_types


@dataclass(frozen=True)
class FootContact:
    """How feet hold on to the ground."""

    friction: float = 1.0
    """Coefficient of sliding friction between the ground and feet or trunk."""
    grasp: float = 0.0
    """Adhesion of a foot that the plan lets stand, in multiples of the insect's weight; what presses the feet too
    deep into the ground is refused as the insect settles, about 10 for the stick insect."""

    __post_init__ = check_types


@dataclass(frozen=True)
class Ground:
    """What lies ahead."""

    ground: GroundKind = "flat"
    """What lies ahead: nothing, a step up, a gap, a hurdle, or rough ground, bumps that end on the plane."""
    ground_height: float = 3.0
    """Height of step, hurdle or the highest bump of rough ground [mm]; a gap is as deep as a leg is long."""
    ground_at: float = 50.0
    """Where step, gap, hurdle or rough ground begin, ahead of O at the start [mm]."""
    ground_length: float = 10.0
    """Length of gap or hurdle along the way [mm]."""
    ground_seed: int = 0
    """Of the bumps of rough ground."""

    @property
    def top(self) -> float:
        """Height of the highest ground [mm]."""
        return 0.0 if self.ground in ("flat", "gap") else self.ground_height

    __post_init__ = check_types


@dataclass(frozen=True)
class Numerics:
    """How finely physics is computed, and what counts as a standing foot and as rest."""

    longest_substep: float = 0.625
    """Longest physics step [ms]; a plan's step is divided into the fewest whole substeps within it, and these
    further while a foot strikes the ground."""
    contact_gap: float = 10.0
    """A foot that leaves the ground for no longer still stands in the measured polygon [ms]; 0 counts every bounce."""
    settling_time: float = 200.0
    """Time for which the insect stands before it walks [ms]; whether it has come to rest is checked."""

    __post_init__ = check_types


@dataclass(frozen=True)
class Conditions:
    """The conditions of a physical walk."""

    time: TimeScale = field(default_factory=TimeScale)
    path: FootPath = field(default_factory=FootPath)
    masses: Masses = field(default_factory=Masses)
    contact: FootContact = field(default_factory=FootContact)
    ground: Ground = field(default_factory=Ground)
    numerics: Numerics = field(default_factory=Numerics)
    body: Body = STICK_INSECT
    """What walks; its lengths bound the other conditions."""

    def __post_init__(self) -> None:
        check_types(self)
        flat = self.flat()
        idle = {one for one in vars(Ground()).items() if one[0] not in OBEYED[self.ground.ground]}  # made for no body
        for name, bound in bounds(self.body).items():
            if (name, flat[name]) not in idle:
                bound.check(name, flat[name])
        lengths = self.body.lengths
        if self.ground.ground == "rough":
            rough = Bound(lengths.lowest_bump, lengths.highest_bump, "mm where rough", closed=True)
            rough.check("ground_height", self.ground.ground_height)
        whole("ground_seed", self.ground.ground_seed, 0, 2**63 - 1)

    @classmethod
    def of(cls, **values: Any) -> "Conditions":
        """The usual conditions but for these, by name, `body` among them: ``Conditions.of(vp=20.0, load=1.0)``.

        Raises:
            InputError: no such condition, or a value that makes no sense.
        """
        return cls().but(**values)

    def but(self, **values: Any) -> "Conditions":
        """These conditions but for some, by name, `body` among them.

        Raises:
            InputError: no such condition, or a value that makes no sense.
        """
        valid = (*self.flat(), "body")
        if unknown := set(values) - set(valid):
            raise InputError(f"condition {min(unknown)!r}; valid names: {', '.join(valid)}")
        parts = {
            name: replace(part, **{key: value for key, value in values.items() if key in vars(part)})
            for name, part in self._parts().items()
        }
        return replace(self, **parts, body=values.get("body", self.body))

    def flat(self) -> dict[str, Any]:
        """Every condition by its own name."""
        return {key: value for part in self._parts().values() for key, value in vars(part).items()}

    def settings(self) -> dict[str, Any]:
        """The conditions and the body's name as plain data."""
        return self.flat() | {"body": self.body.name}

    def _parts(self) -> dict[str, Any]:
        """All but the body."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "body"}

    def substeps(self, stride: Stride) -> int:
        """Physics steps in one step of a plan."""
        return math.ceil(1000.0 * self.time.seconds(stride) / self.numerics.longest_substep - ROUNDING)

    def timestep(self, stride: Stride) -> float:
        """The physics step [s]."""
        return self.time.seconds(stride) / self.substeps(stride)


def unusual(told: Mapping[str, Any]) -> list[str]:
    """Names of conditions worth telling, of `Conditions.settings` or `flat`: what the ground at hand obeys, and what
    is not as usual."""
    usual, obeyed = Conditions().settings(), OBEYED[told.get("ground", "flat")]
    return [name for name, value in told.items() if name in obeyed or value != usual[name]]


def check_obeyed(conditions: Conditions) -> None:
    """Refuse measures of an obstacle that the ground has not got: a walk would not obey them.

    Raises:
        InputError: one of them is not as usual.
    """
    for name in vain(conditions.ground):
        told = f"{name} = {getattr(conditions.ground, name)} with ground = {conditions.ground.ground}"
        raise InputError(f"{told}; expected it with a ground that has it")


def vain(ground: Ground) -> list[str]:
    """Names of a ground's measures that are not as usual, though its kind does not obey them."""
    usual, obeyed = vars(Ground()), ("ground", *OBEYED[ground.ground])
    return [name for name, value in vars(ground).items() if name not in obeyed and value != usual[name]]


def bounds(body: Body) -> dict[str, Bound]:
    """What each condition may be, by its own name, for a body."""
    lengths = body.lengths
    return {
        "vp": Bound(lengths.slowest_swing, lengths.fastest_swing, "mm/s"),
        "step_height": Bound(0.0, lengths.highest_lift, "mm"),
        "standing_height": Bound(0.0, lengths.highest_stand, "mm"),
        "lift_time": Bound(0.0, 1000.0, "ms"),
        "landing_time": Bound(0.0, 1000.0, "ms"),
        "load": Bound(0.0, 10.0, "times the insect's weight", closed=True),
        "centre_of_mass": Bound(-lengths.farthest_centre_of_mass, lengths.farthest_centre_of_mass, "mm", closed=True),
        "leg_mass": Bound(0.0, 2.0, "times the insect's own"),
        "friction": Bound(0.0, 1000.0, "", closed=True),
        "grasp": Bound(0.0, 100.0, "times the insect's weight", closed=True),
        "ground_height": Bound(0.0, lengths.shortest_leg, "mm, the length of the shortest leg"),
        "ground_at": Bound(
            lengths.nearest_obstacle, lengths.farthest_obstacle, "mm, ahead of the front feet", closed=True
        ),
        "ground_length": Bound(0.0, lengths.longest_obstacle, "mm"),
        "longest_substep": Bound(0.001, 1000.0 * body.longest_step, "ms, which the contacts are made for"),
        "contact_gap": Bound(0.0, 1000.0, "ms", closed=True),
        "settling_time": Bound(0.0, 10000.0, "ms"),
    }
