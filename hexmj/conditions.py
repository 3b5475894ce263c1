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

GroundKind = Literal["flat", "step", "stairs", "gap", "hurdle", "rough"]
"""Kind of ground, see `Conditions.ground`."""

GROUND_MEASURES: dict[GroundKind, tuple[str, ...]] = {
    "flat": (),
    "step": ("ground_height", "ground_at"),
    "stairs": ("ground_height", "ground_at", "ground_length"),
    "gap": ("ground_at", "ground_length"),
    "hurdle": ("ground_height", "ground_at", "ground_length"),
    "rough": ("ground_height", "ground_at", "ground_seed"),
}
"""Kind of ground -> names of the conditions that describe this kind."""

STAIRS = 5
"""Number of steps of the ground 'stairs'."""

STEEPEST = 0.7
"""Maximum magnitude of `Conditions.pitch` and `roll` [rad]: 40 degrees."""

ROUNDING = 1e-9
"""Relative tolerance in comparisons and divisions of durations."""


@dataclass(frozen=True)
class Conditions:
    """The conditions of a physical walk, for example `Conditions(vp=20.0, load=1.0)`.

    Raises:
        InputError: a value is outside of the range that the body allows.
    """

    vp: float = 80.0
    """Velocity V_p of a swinging foot relative to the body [mm/s]; the plan's time unit is 1 mm / V_p."""

    step_height: float = 12.0
    """Height to which a swinging foot is lifted [mm]. The default exceeds the clearance of the trunk, so that a
    swinging foot does not support a falling body."""
    standing_height: float = 10.0
    """Height of the root above the tips of standing legs [mm]."""
    lift_time: float = 20.0
    """Time in which a foot is raised after lift-off [ms]. Much shorter times make standing feet hop."""
    landing_time: float = 20.0
    """Time in which a foot is lowered, ending at its AEP [ms]. With shorter times the foot strikes the ground."""

    load: float = 0.0
    """Weight of a load carried at O, in multiples of the insect's own weight."""
    centre_of_mass: float = 0.0
    """Distance of the centre of mass, load included, ahead of O in posture home [mm]. In the animal it is -9.4 mm,
    1.4 mm behind the hind coxae. Masses of the trunk are shifted; none is added."""
    leg_mass: float = 1.0
    """Mass of the legs in multiples of its default. The trunk's mass changes so that the total mass stays the same.
    The paper's legs are massless."""

    friction: float = 1.0
    """Coefficient of sliding friction of feet and trunk on the ground."""
    grasp: float = 0.0
    """Adhesion of a standing foot, in multiples of the insect's weight. From about 10 on, walks of the stick insect are
    refused, since adhesion presses its feet too deep into the ground."""

    ground: GroundKind = "flat"
    """Kind of ground ahead: flat, a step up, five stairs, a gap, a hurdle, or rough (a field of bumps)."""
    ground_height: float = 3.0
    """Height of a step, stair or hurdle, or maximum height of bumps [mm]. A gap is as deep as the shortest leg is
    long."""
    ground_at: float = 50.0
    """Distance from O at the start to the step, stairs, gap, hurdle or rough ground [mm]."""
    ground_length: float = 10.0
    """Length of a stair, gap or hurdle in the direction of walking [mm]."""
    ground_seed: int = 0
    """Seed of the random heights of the bumps of rough ground."""
    pitch: float = 0.0
    """Angle by which the ground rises ahead of the start [rad]; gravity is tilted, the ground stays at z = 0."""
    roll: float = 0.0
    """Angle by which the ground rises to the left of the start [rad]."""
    softness: float = 0.0
    """Time constant of the contacts with soft ground [ms]; 0 is hard ground, whose time constant is two physics
    steps."""

    longest_substep: float = 0.625
    """Maximum physics step [ms]. Each step of the plan is divided into the fewest equal physics steps that are not
    longer. While a foot strikes the ground, physics steps are shorter."""
    contact_gap: float = 10.0
    """Maximum time off the ground for which a foot still counts as standing [ms]; at 0 a bounce is a lift-off."""
    settling_time: float = 200.0
    """Time for which the insect stands before it walks [ms]. An insect that is not at rest by then is an error."""

    body: Body = STICK_INSECT
    """Body that walks; its lengths limit the ranges of the other conditions."""

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
        """Return the conditions as plain data by name; the name of the body stands for the body."""
        return self.values() | {"body": self.body.name}

    def values(self) -> dict[str, Any]:
        """Return the values of all conditions except the body, by name."""
        return {field.name: getattr(self, field.name) for field in fields(Conditions) if field.name != "body"}

    def seconds(self, stride: Stride) -> float:
        """Return the duration of one step of a plan [s]."""
        return stride.dt / self.vp

    @property
    def landing_distance(self) -> float:
        """Distance before the AEP at which the lowering of a swinging tip begins [mm]."""
        return self.vp * self.landing_time / 1000.0

    @property
    def highest_ground(self) -> float:
        """Maximum height of the ground above z = 0 [mm]."""
        return {"flat": 0.0, "gap": 0.0, "stairs": STAIRS * self.ground_height}.get(self.ground, self.ground_height)

    @property
    def down(self) -> tuple[float, float, float]:
        """Direction of gravity in the frame of the ground, a unit vector."""
        ahead, left = -math.sin(self.pitch), -math.sin(self.roll)
        return ahead + 0.0, left + 0.0, -math.sqrt(1.0 - ahead**2 - left**2)

    def substeps(self, stride: Stride) -> int:
        """Return the number of physics steps in one step of a plan."""
        return math.ceil(1000.0 * self.seconds(stride) / self.longest_substep - ROUNDING)

    def timestep(self, stride: Stride) -> float:
        """Return the duration of one physics step [s]."""
        return self.seconds(stride) / self.substeps(stride)


SCALARS = tuple(field.name for field in fields(Conditions) if field.type in (float, int))
"""Names of the conditions that are numbers."""


def unusual(settings: Mapping[str, Any]) -> list[str]:
    """Return the names of the conditions that differ from their defaults or describe the kind of ground.

    Args:
        settings: conditions by name, from `Conditions.settings` or `Conditions.values`.
    """
    defaults, measures = Conditions().settings(), GROUND_MEASURES[settings.get("ground", "flat")]
    return [name for name, value in settings.items() if name in measures or value != defaults[name]]


def check_ground(conditions: Conditions) -> None:
    """Raise InputError if a condition that describes another kind of ground differs from its default."""
    measures, defaults = GROUND_MEASURES[conditions.ground], Conditions().values()
    for name in ("ground_height", "ground_at", "ground_length", "ground_seed"):
        if name not in measures and (value := getattr(conditions, name)) != defaults[name]:
            raise InputError(f"{name} = {value} has no effect with ground = {conditions.ground!r}")


def ranges(body: Body, ground: GroundKind) -> dict[str, tuple[float, float, bool]]:
    """Return the range of each condition for a body: minimum, maximum, and whether the minimum itself is excluded."""
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
        "pitch": (-STEEPEST, STEEPEST, False),
        "roll": (-STEEPEST, STEEPEST, False),
        "softness": (0.0, 100.0, False),
        "ground_height": heights,
        "ground_at": (lengths.nearest_obstacle, lengths.farthest_obstacle, False),
        "ground_length": (0.0, lengths.longest_obstacle, True),
        "longest_substep": (0.001, 1000.0 * body.longest_step, True),
        "contact_gap": (0.0, 1000.0, False),
        "settling_time": (0.0, 10000.0, True),
    }
