"""Description of a six-legged body: its MJCF, the names in it, the lengths behind its limits; and the stick insect.

Units are mm, g, s and rad, forces g mm/s^2, in the MJCF too.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path

from hexmj.errors import InputError
from hexmj.legs import FIG1, LEGS, Geometry

ROOT_QPOS = 7
"""Numbers of `qpos` before the joints: the free root's position (3) and unit quaternion (4)."""

ROOT_QVEL = 6
"""Numbers of `qvel` before the joints: the free root's velocity (3) and angular velocity (3)."""

FEWEST_JOINTS = 3
"""Hinges that a leg needs to put its foot anywhere in space."""


@dataclass(frozen=True)
class Leg:
    """One leg by its names in the MJCF."""

    joints: tuple[str, ...]
    """Its hinges from the body outwards, each with a range."""
    foot: str
    """The site at its tip, and the sphere around it that stands on the ground."""
    parts: tuple[str, ...]
    """The bodies whose mass is the leg's; the foot's is one of them."""


@dataclass(frozen=True)
class Servo:
    """What the gains of the joints are computed from, see `bodies.mjcf`."""

    step: float = 0.001
    """The time step for which the joints are as stiff as it allows [s]."""
    damping_ratio: float = 1.0
    """Of the lightest motion of each joint; 1 is critical."""
    digits: int = 2
    """Significant digits of the gains."""


@dataclass(frozen=True)
class Lengths:
    """The lengths, and one speed, that limits and tolerances are made of; by default those of the stick insect."""

    highest_lift: float = 14.0
    """Greatest height to which a swinging foot is lifted [mm]."""
    highest_stand: float = 14.0
    """Greatest standing height [mm]."""
    slowest_swing: float = 0.1
    """Least velocity V_p of a protracting tip relative to the body [mm/s]."""
    fastest_swing: float = 2000.0
    """Greatest velocity V_p [mm/s]."""
    shortest_leg: float = 31.0
    """Length of the shortest leg [mm]: no obstacle is taller, and a gap is as deep."""
    farthest_centre_of_mass: float = 30.0
    """How far the centre of mass may be moved ahead or back [mm]."""
    load_gyration: float = 2.0
    """Radius of gyration of what is carried [mm]."""
    nearest_obstacle: float = 45.0
    """Least distance of what lies ahead from O at the start, ahead of the front feet [mm]."""
    farthest_obstacle: float = 10000.0
    """Greatest distance of what lies ahead from O at the start [mm]."""
    longest_obstacle: float = 1000.0
    """Greatest length of a gap or a hurdle along the way [mm]."""
    highest_bump: float = 8.0
    """Height of the highest bump of rough ground [mm]; bumps are caps of spheres, twice as wide."""
    bump_spacing: float = 12.0
    """Distance of the bumps' centres [mm]; neighbours leave only small gaps."""
    ground_half_width: float = 200.0
    """Half the width of everything that lies ahead [mm]."""
    ground_reach: float = 1000.0
    """How far steps and the banks of a gap reach [mm]."""
    speed_at_rest: float = 5.0
    """Speed of the root below which a start counts as settled [mm/s]."""
    tracking_bin: float = 0.01
    """Width of the bins in which distances of feet from their targets are counted [mm]."""
    tracking_bins: int = 2000
    """Number of these bins; greater distances are counted together."""
    largest_tip_offset: float = 5.0
    """Greatest offset of a planned tip in each direction that an environment's action may ask for [mm]."""
    no_foot_margin: float = -100.0
    """Stands for the stability margin of a body without a foot on the ground [mm]; a foot in contact gives more,
    since no leg reaches so far."""

    @property
    def lowest_bump(self) -> float:
        """Least height of the highest bump of rough ground [mm].

        Lower ones are caps of spheres so large, of radius `highest_bump`^2 / 2 h, that a foot touches many at once,
        which makes the ground harder and slower to compute: at 0.1 mm four, at 0.0001 mm fifty.
        """
        return self.highest_bump / 80.0

    def scaled(self, factor: float) -> "Lengths":
        """The lengths of a body so many times as large; speeds grow with them, the number of bins does not."""
        values = {field.name: getattr(self, field.name) * factor for field in fields(self)}
        return Lengths(**(values | {"tracking_bins": self.tracking_bins}))


@dataclass(frozen=True)
class Marks:
    """Sizes of the marks that a film draws on the ground and at the tips [mm]."""

    fill_height: float = 0.05
    """Height of the support polygon's area over the ground; its outline lies on the ground."""
    outline: float = 0.45
    """Radius of the polygon's outline."""
    plumb_line: float = 0.12
    """Radius of the line from the centre of mass down to the ground."""
    rim: tuple[float, float] = (2.4, 0.3)
    """Radius and half height of the disc whose rim shows whether the body is stable."""
    centre: tuple[float, float] = (1.6, 0.4)
    """Radius and half height of the disc below the centre of mass."""
    tip: float = 1.0
    """Radius of the ball at a planned tip."""


@dataclass(frozen=True)
class Body:
    """A six-legged body, described so that it can be compiled, loaded with masses, put on any ground and walked."""

    name: str
    """What it is called where bodies are listed."""
    mjcf: Path
    """Its MJCF file; may include others and refer to meshes beside it."""
    root: str
    """Body with the free joint.  Its frame is at O: x forward, y left, z up."""
    trunk: tuple[str, ...]
    """Parts from front to rear, names of bodies and of their geoms, that fall on the ground; they carry the mass that
    is not the legs'."""
    legs: tuple[Leg, ...]
    """The six legs in the order of `LEGS`."""
    ground: str
    """Geom of the plane on which it stands."""
    home: str
    """Keyframe in which the feet stand on the origins of their lines."""
    cameras: tuple[str, ...]
    """From which it can be filmed."""
    lines: Geometry
    """Lines of the tips in posture `home`."""
    standing_height: float
    """Height of the root's frame above the tips in posture `home` [mm]."""
    longest_step: float
    """Longest time step that its gains and contacts allow [s]."""
    mass: float
    """Its own mass [g]."""
    servo: Servo
    """What its gains are computed from."""
    lengths: Lengths
    """What limits and tolerances are made of."""
    marks: Marks
    """Sizes of a film's marks."""

    def __repr__(self) -> str:
        return f"Body({self.name!r}, {self.mjcf.name})"

    def __post_init__(self) -> None:
        for fault in self._faults():
            raise InputError(f"body {self.name!r}: {fault}")

    def _faults(self) -> Iterator[str]:
        numbers = {name: getattr(self, name) for name in ("mass", "standing_height", "longest_step")}
        numbers |= vars(self.servo) | vars(self.lengths) | {"no_foot_margin": -self.lengths.no_foot_margin}
        for name, number in numbers.items():
            if not 0 < number < math.inf:
                yield f"{name} = {number}; expected a finite number above 0"
        if not self.mjcf.is_file():
            yield f"mjcf = {str(self.mjcf)!r} is no file; expected the body's MJCF"
        if not self.trunk:
            yield "trunk = (); expected the names of at least one part"
        if len(self.legs) != len(LEGS):
            yield f"{len(self.legs)} legs; expected {len(LEGS)}, in the order {', '.join(LEGS)}"
        numbers = [len(leg.joints) for leg in self.legs]
        if len(set(numbers)) > 1 or numbers[0] < FEWEST_JOINTS:
            has, least = ", ".join(map(str, numbers)), FEWEST_JOINTS
            yield f"its legs have {has} joints; expected equally many in each, at least {least}"
        parts = tuple(part for leg in self.legs for part in leg.parts)
        yield from (f"trunk part {name!r} is a leg's; expected other parts" for name in self.trunk if name in parts)
        named = {"joints": self.joints, "feet": self.feet, "trunk": self.trunk, "parts of legs": parts}
        for kind, names in named.items():
            twice = (name for i, name in enumerate(names) if name in names[:i])
            yield from (f"{kind} name {name!r} twice; expected every name once" for name in twice)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints, leg by leg, each leg's from the body outwards."""
        return tuple(joint for leg in self.legs for joint in leg.joints)

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet, (leg,)."""
        return tuple(leg.foot for leg in self.legs)


JOINTS = ("thorax_coxa", "coxa_trochanter", "femur_tibia")
"""A leg's joints from the body outwards; their angles are protraction, levation, the knee's inner angle."""

PARTS = ("coxa", "femur", "tibia")
"""A leg's parts from the body outwards; the tibia includes the tarsus."""


def _mjcf() -> Path:
    """The file in the wheel, else in the repository."""
    packaged = Path(str(files("hexmj"))) / "assets"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[1] / "assets"
    return folder / "stick_insect.xml"


STICK_INSECT = Body(
    name="stick_insect",
    mjcf=_mjcf(),
    root="mesothorax",
    trunk=("head", "prothorax", "mesothorax", "metathorax", "abdomen"),
    legs=tuple(
        Leg(
            joints=tuple(f"{leg}_{joint}" for joint in JOINTS),
            foot=f"{leg}_foot",
            parts=tuple(f"{leg}_{part}" for part in PARTS),
        )
        for leg in LEGS
    ),
    ground="ground",
    home="home",
    cameras=("following", "side", "top", "front"),
    lines=FIG1,
    standing_height=10.0,
    longest_step=0.000625,
    mass=1.0,
    servo=Servo(),
    lengths=Lengths(),
    marks=Marks(),
)
"""The insect of this package; standing height and times of `hexmj.conditions` are usual for it."""
