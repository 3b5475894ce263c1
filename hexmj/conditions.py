"""The conditions of a physical walk: time scale, path of the feet, masses, contact, ground, numerics and body.

Every condition is a field of one flat class, and has the same name on the command line, in recordings and in results.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from hexmj.body import STICK_INSECT, Body
from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.validate import choice, number, whole

GroundKind = Literal["flat", "step", "gap", "hurdle", "rough"]
"""Kinds of ground, see `Conditions.ground`."""

GROUND_MEASURES: dict[GroundKind, tuple[str, ...]] = {
    "flat": (),
    "step": ("ground_height", "ground_at"),
    "gap": ("ground_at", "ground_length"),
    "hurdle": ("ground_height", "ground_at", "ground_length"),
    "rough": ("ground_height", "ground_at", "ground_seed"),
}
"""Kind of ground -> the conditions that describe it."""

ROUNDING = 1e-9
"""Relative tolerance with which physics steps fit into a step of the plan."""


@dataclass(frozen=True)
class Conditions:
    """The conditions of a physical walk, for example `Conditions(vp=20.0, load=1.0)`.

    Raises:
        InputError: a value is out of the range that the body allows.
    """

    vp: float = 80.0
    """Velocity V_p of a protracting tip relative to the body [mm/s]; the plan's time unit is 1 mm / V_p."""

    step_height: float = 12.0
    """Height to which a swinging foot is lifted [mm]. It exceeds the trunk's clearance, so that a swinging foot does
    not catch a falling body."""
    standing_height: float = 10.0
    """Height of the root above the standing tips [mm]."""
    lift_time: float = 20.0
    """Time in which a foot is raised [ms]. With much shorter times standing feet hop."""
    landing_time: float = 20.0
    """Time in which a foot is lowered before it reaches its AEP [ms]. With shorter times it strikes the ground."""

    load: float = 0.0
    """Weight carried at O, in multiples of the insect's own."""
    centre_of_mass: float = 0.0
    """Distance of the centre of mass, load included, ahead of O in the home posture [mm]. The animal's is at -9.4,
    1.4 mm behind the hind coxae. The trunk's masses are moved, none is added."""
    leg_mass: float = 1.0
    """Mass of the legs as a fraction of the insect's own; the trunk makes up for it. The paper's legs have none."""

    friction: float = 1.0
    """Coefficient of sliding friction between the ground and feet or trunk."""
    grasp: float = 0.0
    """Adhesion of a standing foot, in multiples of the insect's weight. About 10 presses the stick insect's feet too
    deep into the ground to settle."""

    ground: GroundKind = "flat"
    """Ground ahead: flat, a step up, a gap, a hurdle, or rough ground, whose bumps end on the plane."""
    ground_height: float = 3.0
    """Height of a step, a hurdle or the highest bump of rough ground [mm]; a gap is as deep as a leg is long."""
    ground_at: float = 50.0
    """Distance from O at the start to the step, gap, hurdle or rough ground [mm]."""
    ground_length: float = 10.0
    """Length of a gap or hurdle along the way [mm]."""
    ground_seed: int = 0
    """Seed of the bumps of rough ground."""

    longest_substep: float = 0.625
    """Longest physics step [ms]. A step of the plan is divided into the fewest whole substeps within it, and these
    further while a foot strikes the ground."""
    contact_gap: float = 10.0
    """A foot that leaves the ground for at most this time still counts as standing [ms]; 0 counts every bounce."""
    settling_time: float = 200.0
    """Time for which the insect stands before it walks [ms]. Whether it has come to rest is checked."""

    body: Body = STICK_INSECT
    """Body that walks; its lengths bound the other conditions."""

    def __post_init__(self) -> None:
        if not isinstance(self.body, Body):
            raise InputError(f"body = {self.body!r:.80}; expected a hexmj.Body")
        choice("ground", self.ground, GROUND_MEASURES)
        object.__setattr__(self, "ground_seed", whole("ground_seed", self.ground_seed, 0, 2**63 - 1))
        for name, (least, most, above) in ranges(self.body, self.ground).items():
            value = getattr(self, name)
            absent = name.startswith("ground_") and name not in GROUND_MEASURES[self.ground]
            if not (absent and value == Conditions.__dataclass_fields__[name].default):
                value = number(name, value, least, most, above=above)
            object.__setattr__(self, name, float(value))

    def settings(self) -> dict[str, Any]:
        """Return the conditions as plain data, with the body's name."""
        return self.values() | {"body": self.body.name}

    def values(self) -> dict[str, Any]:
        """Return every condition but the body by name."""
        return {field.name: getattr(self, field.name) for field in fields(Conditions) if field.name != "body"}

    def seconds(self, stride: Stride) -> float:
        """Duration of one step of a plan [s]."""
        return stride.dt / self.vp

    @property
    def landing_distance(self) -> float:
        """Distance before its AEP at which a tip begins to be lowered [mm]."""
        return self.vp * self.landing_time / 1000.0

    @property
    def highest_ground(self) -> float:
        """Height of the highest ground [mm]."""
        return 0.0 if self.ground in ("flat", "gap") else self.ground_height

    def substeps(self, stride: Stride) -> int:
        """Physics steps in one step of a plan."""
        return math.ceil(1000.0 * self.seconds(stride) / self.longest_substep - ROUNDING)

    def timestep(self, stride: Stride) -> float:
        """Physics step [s]."""
        return self.seconds(stride) / self.substeps(stride)


def unusual(settings: Mapping[str, Any]) -> list[str]:
    """Names of the conditions that differ from the defaults, and of those that describe the ground.

    Args:
        settings: as of `Conditions.settings` or `Conditions.values`.
    """
    defaults, measures = Conditions().settings(), GROUND_MEASURES[settings.get("ground", "flat")]
    return [name for name, value in settings.items() if name in measures or value != defaults[name]]


def check_ground(conditions: Conditions) -> None:
    """Raise InputError if a measure of an obstacle is set that this kind of ground does not have."""
    measures, defaults = GROUND_MEASURES[conditions.ground], Conditions().values()
    for name in ("ground_height", "ground_at", "ground_length", "ground_seed"):
        if name not in measures and (value := getattr(conditions, name)) != defaults[name]:
            raise InputError(f"{name} = {value} has no effect with ground = {conditions.ground!r}")


def ranges(body: Body, ground: GroundKind) -> dict[str, tuple[float, float, bool]]:
    """Range of each condition for a body: the least value, the greatest, and whether it must be above the least."""
    lengths = body.lengths
    heights = (
        (0.0, lengths.shortest_leg, True) if ground != "rough" else (lengths.lowest_bump, lengths.highest_bump, False)
    )
    return {
        "vp": (lengths.slowest_swing, lengths.fastest_swing, True),
        "step_height": (0.0, lengths.highest_lift, True),
        "standing_height": (0.0, lengths.highest_stand, True),
        "lift_time": (0.0, 1000.0, True),
        "landing_time": (0.0, 1000.0, True),
        "load": (0.0, 10.0, False),
        "centre_of_mass": (-lengths.farthest_centre_of_mass, lengths.farthest_centre_of_mass, False),
        "leg_mass": (0.0, 2.0, True),
        "friction": (0.0, 1000.0, False),
        "grasp": (0.0, 100.0, False),
        "ground_height": heights,
        "ground_at": (lengths.nearest_obstacle, lengths.farthest_obstacle, False),
        "ground_length": (0.0, lengths.longest_obstacle, True),
        "longest_substep": (0.001, 1000.0 * body.longest_step, True),
        "contact_gap": (0.0, 1000.0, False),
        "settling_time": (0.0, 10000.0, True),
    }
