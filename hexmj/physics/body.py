"""The conditions of a physical walk: how the network's plan is carried out by the insect in MuJoCo."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from hexmj.errors import InputError
from hexmj.parameters import Network

Ground = Literal["flat", "step", "gap", "hurdle", "rough"]
"""Kinds of ground, see `Body.ground`."""

SHORTEST_LEG = 31.0
"""Length of the shortest leg, the middle one [mm]; no obstacle is taller."""

HIGHEST_BUMP = 8.0
"""Height of the highest bump of rough ground [mm]; they are caps of spheres, 16 mm wide."""


@dataclass(frozen=True)
class Body:
    """Conditions of a physical walk; those that matter or are not as usual are printed with every physical measure."""

    vp: float = 80.0
    """Velocity V_p of a protracting tip relative to the body [mm/s]; links the network's time unit, 1 mm / V_p,
    to seconds."""
    step_height: float = 12.0
    """Height to which a swinging foot is lifted [mm]; above the trunk's clearance, or the foot catches a falling
    body."""
    standing_height: float = 10.0
    """Height of the middle coxae above the standing tips [mm]."""
    lift_time: float = 20.0
    """Time in which a foot is raised [ms]; much shorter ones make feet hop that stand."""
    landing_time: float = 20.0
    """Time in which a foot is lowered, from before its AEP [ms]; shorter ones let it strike the ground."""
    friction: float = 1.0
    """Coefficient of sliding friction between the ground and feet or trunk."""
    longest_substep: float = 0.625
    """Longest physics step [ms]; the network's step is divided into the fewest whole substeps within it, and these
    further while a foot strikes the ground."""
    contact_gap: float = 10.0
    """A foot that leaves the ground for no longer still stands in the measured polygon [ms]; 0 counts every bounce."""
    settling_time: float = 200.0
    """Time for which the insect stands before it walks [ms]; whether it has come to rest is checked."""
    load: float = 0.0
    """Weight carried at O, in multiples of the insect's own."""
    centre_of_mass: float = 0.0
    """How far ahead of O the centre of mass lies when all legs are at home [mm]; the animal's is at -9.4, 1.4 mm
    behind the hind coxae.  The trunk's masses are moved, none is added."""
    leg_mass: float = 1.0
    """Mass of the legs as a fraction of the insect's own; the trunk makes up for it.  The paper's legs have none."""
    grasp: float = 0.0
    """Adhesion of a foot that the plan lets stand, in multiples of the insect's weight."""
    feedback: bool = False
    """The network reads the legs before each of its steps, where the tips are and which feet meet the ground, instead
    of going on by itself."""
    ground: Ground = "flat"
    """What lies ahead: nothing, a step up, a gap, a hurdle, or rough ground."""
    ground_height: float = 3.0
    """Height of step, hurdle or the highest bump of rough ground [mm]; a gap is as deep as a leg is long."""
    ground_at: float = 50.0
    """Where step, gap, hurdle or rough ground begin, ahead of O at the start [mm]."""
    ground_length: float = 10.0
    """Length of gap or hurdle along the way [mm]."""
    ground_seed: int = 0
    """Of the bumps of rough ground."""

    def __post_init__(self) -> None:
        bounds = {
            "vp": (0.1, 2000.0, "mm/s"),
            "step_height": (0.0, 14.0, "mm"),
            "standing_height": (0.0, 14.0, "mm"),
            "lift_time": (0.0, 1000.0, "ms"),
            "landing_time": (0.0, 1000.0, "ms"),
            "longest_substep": (0.001, 0.625, "ms, which the contacts are made for"),
            "settling_time": (0.0, 10000.0, "ms"),
            "leg_mass": (0.0, 2.0, "times the insect's own"),
            "ground_height": (0.0, SHORTEST_LEG, "mm, the length of the shortest leg"),
            "ground_length": (0.0, 1000.0, "mm"),
        }
        for name, (low, high, unit) in bounds.items():
            value = getattr(self, name)
            if not low < value <= high:
                raise InputError(f"{name} = {value}; expected above {low:g} and at most {high:g} {unit}")
        closed = {
            "contact_gap": (0.0, 1000.0, "ms"),
            "load": (0.0, 10.0, "times the insect's weight"),
            "grasp": (0.0, 100.0, "times the insect's weight"),
            "centre_of_mass": (-30.0, 30.0, "mm"),
            "ground_at": (45.0, 10000.0, "mm, ahead of the front feet"),
        }
        for name, (low, high, unit) in closed.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"{name} = {value}; expected {low:g} to {high:g} {unit}")
        if self.ground not in get_args(Ground):
            raise InputError(f"ground = {self.ground!r}; valid names: {', '.join(get_args(Ground))}")
        if self.ground == "rough" and self.ground_height > HIGHEST_BUMP:
            raise InputError(f"ground_height = {self.ground_height}; expected at most {HIGHEST_BUMP:g} mm where rough")
        if not (isinstance(self.ground_seed, int) and self.ground_seed >= 0):
            raise InputError(f"ground_seed = {self.ground_seed}; expected an integer of at least 0")
        if not 0 <= self.friction < math.inf:
            raise InputError(f"friction = {self.friction}; expected a finite number of at least 0")

    @property
    def landing_distance(self) -> float:
        """How far before its AEP a tip begins to be lowered [mm]."""
        return self.vp * self.landing_time / 1000.0

    def seconds(self, network: Network) -> float:
        """Duration of one step of the network [s]."""
        return network.dt / self.vp

    def substeps(self, network: Network) -> int:
        """Physics steps in one step of the network."""
        return math.ceil(1000.0 * self.seconds(network) / self.longest_substep - 1e-9)
