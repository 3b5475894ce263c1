"""`Body`, the description of a six-legged body: its MJCF file, the names in it and its lengths; and the stick insect.

Units are mm, g, s and rad, also in the MJCF; forces are in g mm/s^2.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path

from hexmj.errors import InputError
from hexmj.legs import FIG1, LEGS, Geometry

ROOT_QPOS = 7
"""Number of elements of `qpos` before the joints: the free root's position (3) and unit quaternion (4)."""

ROOT_QVEL = 6
"""Number of elements of `qvel` before the joints: the free root's velocity (3) and angular velocity (3)."""

FEWEST_JOINTS = 3
"""Minimum number of hinges of a leg; with fewer, a foot cannot move in all three directions."""


@dataclass(frozen=True)
class Leg:
    """One leg, described by names in the MJCF."""

    joints: tuple[str, ...]
    """Names of the leg's hinges from the body outwards; each hinge must have a range."""
    foot: str
    """Name of the site at the leg's tip, and of the sphere around this site that stands on the ground."""
    parts: tuple[str, ...]
    """Names of the bodies whose mass counts as the leg's mass; the body that has the foot is one of them."""


@dataclass(frozen=True)
class Servo:
    """Settings from which `bodies.mjcf` computes the gains of the joints' servos."""

    step: float = 0.001
    """The joints get the greatest stiffness that this time step allows [s]."""
    damping_ratio: float = 1.0
    """Damping ratio of each servo, as MuJoCo's `dampratio`; 1 is critical damping."""
    digits: int = 2
    """Number of significant digits to which the gains are rounded."""


@dataclass(frozen=True)
class Lengths:
    """Lengths and speeds from which limits and tolerances are computed; the defaults are those of the stick insect."""

    highest_lift: float = 14.0
    """Maximum height to which a swinging foot can be lifted [mm]."""
    highest_stand: float = 14.0
    """Maximum standing height [mm]."""
    slowest_swing: float = 0.1
    """Minimum velocity V_p of a swinging foot relative to the body [mm/s]."""
    fastest_swing: float = 2000.0
    """Maximum velocity V_p of a swinging foot relative to the body [mm/s]."""
    shortest_leg: float = 31.0
    """Length of the shortest leg [mm]; it is also the maximum height of an obstacle and the depth of a gap."""
    farthest_centre_of_mass: float = 30.0
    """Maximum distance of the centre of mass from O, ahead or to the rear [mm]."""
    load_gyration: float = 2.0
    """Radius of gyration of the load (`Conditions.load`) [mm]."""
    nearest_obstacle: float = 45.0
    """Minimum distance from O at the start to an obstacle, which must lie ahead of the front feet [mm]."""
    farthest_obstacle: float = 10000.0
    """Maximum distance from O at the start to an obstacle [mm]."""
    longest_obstacle: float = 1000.0
    """Maximum length of a gap or a hurdle in the direction of walking [mm]."""
    highest_bump: float = 8.0
    """Maximum height of the bumps of rough ground [mm]; all bumps are caps of spheres, 2 `highest_bump` wide."""
    bump_spacing: float = 12.0
    """Distance between the centres of neighbouring bumps [mm]; only small gaps remain between bumps."""
    ground_half_width: float = 200.0
    """Half the width of a step, a gap or a hurdle, across the direction of walking [mm]."""
    ground_reach: float = 1000.0
    """Length of a step, and of each bank of a gap, in the direction of walking [mm]."""
    speed_at_rest: float = 5.0
    """Maximum speed of the root at which a start counts as settled [mm/s]."""
    tracking_bin: float = 0.01
    """Width of a bin in the histogram of the distances between feet and their targets [mm]."""
    tracking_bins: int = 2000
    """Number of bins in the histogram of the distances between feet and their targets; one more bin is unbounded."""
    largest_tip_offset: float = 5.0
    """Maximum distance, in each direction, by which an environment's action can shift a planned tip [mm]."""
    no_foot_margin: float = -100.0
    """Stability margin that is reported while no foot is on the ground [mm]. It is below every margin with a foot on
    the ground, since no leg reaches so far."""

    @property
    def lowest_bump(self) -> float:
        """Minimum of `Conditions.ground_height` on rough ground [mm].

        A bump of small height h is the cap of a sphere of radius `highest_bump`^2 / 2 h. If h is too small a foot
        touches many such spheres at once, which is harder and slower to compute: four at 0.1 mm, fifty at 0.0001 mm.
        """
        return self.highest_bump / 80.0

    def scaled(self, factor: float) -> "Lengths":
        """Return the lengths of a body `factor` times as large; speeds grow likewise, the number of bins does not."""
        values = {field.name: getattr(self, field.name) * factor for field in fields(self)}
        return Lengths(**(values | {"tracking_bins": self.tracking_bins}))


@dataclass(frozen=True)
class Marks:
    """Sizes of the marks that a film shows on the ground and at the tips [mm]."""

    fill_height: float = 0.05
    """Height of the filled support polygon above the ground; the outline of the polygon lies on the ground."""
    outline: float = 0.45
    """Radius of the rods that outline the support polygon."""
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
    """Description of a six-legged body: all that is needed to compile it, load it and let it walk on any ground."""

    name: str
    """Name of the body in lists, results and error messages."""
    mjcf: Path
    """Path of the MJCF file, which may include other files and refer to meshes beside it."""
    root: str
    """Name of the body with the free joint. The origin of its frame is O; x points forward, y left and z up."""
    trunk: tuple[str, ...]
    """Names of the trunk's parts from front to rear. Each is the name of a body, and of the geom that touches the
    ground in a fall; these bodies have all of the mass that is not the legs'."""
    legs: tuple[Leg, ...]
    """The six legs in the order of `hexmj.legs.LEGS`."""
    ground: str
    """Name of the geom of the plane on which the body stands."""
    home: str
    """Name of the keyframe in which each foot stands on the origin of its line."""
    cameras: tuple[str, ...]
    """Names of the cameras that can film the body."""
    lines: Geometry
    """Lines on which the tips move, with their origins, on which the tips stand in posture `home`."""
    standing_height: float
    """Height of the root's frame above the tips in posture `home` [mm]."""
    longest_step: float
    """Maximum physics step that the gains and contacts allow [s]."""
    mass: float
    """Mass of the body without load [g]."""
    servo: Servo
    """Settings from which the gains of the servos are computed."""
    lengths: Lengths
    """Lengths from which limits and tolerances are computed."""
    marks: Marks
    """Sizes of the marks that a film shows."""

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
            yield f"mjcf = {str(self.mjcf)!r} is not a file; expected the path of the body's MJCF"
        if not self.trunk:
            yield "the trunk has no parts; expected the name of at least one"
        if len(self.legs) != len(LEGS):
            yield f"{len(self.legs)} legs; expected {len(LEGS)}, in the order {', '.join(LEGS)}"
        numbers = [len(leg.joints) for leg in self.legs]
        if len(set(numbers)) > 1 or numbers[0] < FEWEST_JOINTS:
            has, least = ", ".join(map(str, numbers)), FEWEST_JOINTS
            yield f"numbers of joints of the legs: {has}; expected the same number for all, at least {least}"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints, leg by leg; the joints of a leg are in order from the body outwards."""
        return tuple(joint for leg in self.legs for joint in leg.joints)

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet, (leg,)."""
        return tuple(leg.foot for leg in self.legs)


JOINTS = ("thorax_coxa", "coxa_trochanter", "femur_tibia")
"""Joints of a leg from the body outwards; their angles are protraction, levation and the inner angle of the knee."""

PARTS = ("coxa", "femur", "tibia")
"""Parts of a leg from the body outwards; the tibia includes the tarsus."""


def _mjcf() -> Path:
    """Return the path of the stick insect's MJCF in the installed package, or else in the repository."""
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
"""The stick insect, the default body; the other defaults of `hexmj.Conditions` are chosen for it."""
