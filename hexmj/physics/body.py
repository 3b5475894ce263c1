"""The conditions of a physical walk: how the network's plan is carried out by the insect in MuJoCo."""

import math
from dataclasses import dataclass

from hexmj.errors import InputError
from hexmj.parameters import Network


@dataclass(frozen=True)
class Body:
    """Conditions of a physical walk; all of them are printed with every physical measure."""

    vp: float = 80.0
    """Velocity V_p of a protracting tip relative to the body [mm/s]; links the network's time unit, 1 mm / V_p,
    to seconds."""
    step_height: float = 12.0
    """Height to which a swinging foot is lifted [mm]; above the trunk's clearance, or the foot catches a falling
    body."""
    standing_height: float = 10.0
    """Height of the middle coxae above the standing tips [mm]."""
    lift_time: float = 5.0
    """Time in which a foot is raised, and in which it is lowered again [ms]."""
    friction: float = 1.0
    """Coefficient of sliding friction between the ground and feet or trunk."""
    longest_substep: float = 1.0
    """Longest physics step [ms]; the network's step is divided into the fewest whole substeps within it."""
    contact_gap: float = 10.0
    """A foot that leaves the ground for no longer still stands in the measured polygon [ms]; 0 counts every bounce."""
    settling_time: float = 200.0
    """Time for which the insect stands before it walks [ms]; whether it has come to rest is checked."""

    def __post_init__(self) -> None:
        bounds = {
            "vp": (0.1, 2000.0, "mm/s"),
            "step_height": (0.0, 14.0, "mm"),
            "standing_height": (0.0, 14.0, "mm"),
            "lift_time": (0.0, 1000.0, "ms"),
            "longest_substep": (0.001, 1.0, "ms"),
            "settling_time": (0.0, 10000.0, "ms"),
        }
        for name, (low, high, unit) in bounds.items():
            value = getattr(self, name)
            if not low < value <= high:
                raise InputError(f"{name} = {value}; expected above {low:g} and at most {high:g} {unit}")
        if not 0 <= self.contact_gap <= 1000:
            raise InputError(f"contact_gap = {self.contact_gap}; expected 0 to 1000 ms")
        if not 0 <= self.friction < math.inf:
            raise InputError(f"friction = {self.friction}; expected a finite number of at least 0")

    def seconds(self, network: Network) -> float:
        """Duration of one step of the network [s]."""
        return network.dt / self.vp

    def substeps(self, network: Network) -> int:
        """Physics steps in one step of the network."""
        return math.ceil(1000.0 * self.seconds(network) / self.longest_substep - 1e-9)
