"""The stick insect: an adult female Carausius morosus of 1 g, whose feet stand on the lines of Fig. 1.

Where its measures come from stands in its MJCF.
"""

from importlib.resources import files
from pathlib import Path

from hexmj.bodies.description import Body, Leg, Lengths, Marks, Servo
from hexmj.legs import FIG1, LEGS

JOINTS = ("thorax_coxa", "coxa_trochanter", "femur_tibia")
"""A leg's joints from the body outwards; their angles are protraction, levation, the knee's inner angle."""

PARTS = ("coxa", "femur", "tibia")
"""A leg's parts from the body outwards; the tibia includes the tarsus."""


def _mjcf() -> Path:
    """The file in the wheel, else in the repository."""
    packaged = Path(str(files("hexmj"))) / "assets"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[2] / "assets"
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
    servo=Servo(step=0.001, damping_ratio=1.0, digits=2),
    lengths=Lengths(
        highest_lift=14.0,
        highest_stand=14.0,
        slowest_swing=0.1,
        fastest_swing=2000.0,
        shortest_leg=31.0,
        farthest_centre_of_mass=30.0,
        load_gyration=2.0,
        nearest_obstacle=45.0,
        farthest_obstacle=10000.0,
        longest_obstacle=1000.0,
        highest_bump=8.0,
        bump_spacing=12.0,
        ground_half_width=200.0,
        ground_reach=1000.0,
        speed_at_rest=5.0,
        tracking_bin=0.01,
        tracking_bins=2000,
        largest_tip_offset=5.0,
        no_foot_margin=-100.0,
    ),
    marks=Marks(fill_height=0.05, outline=0.45, plumb_line=0.12, rim=(2.4, 0.3), centre=(1.6, 0.4), tip=1.0),
)
"""The insect of this package; standing height and times of `hexmj.conditions` are usual for it."""
