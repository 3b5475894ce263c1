"""What Section 5 simulates: measurements, each of a few seconds, in which the paper's claims are looked up.

A measurement is taken velocity by velocity.
"""

from dataclasses import dataclass, field, replace
from typing import Any

from hexmj.checks import check_types, whole
from hexmj.controllers.cruse1998 import MODEL_VARIANTS, PRESETS, Cruse1998, ModelVariant, Order
from hexmj.errors import InputError
from hexmj.paper.found_sets import found_set
from hexmj.paper.measurements import Looks, footfalls, limit_regimes, losses
from hexmj.paper.obstacles import Answer, losses_after
from hexmj.starts import MOST_STARTS, SAMPLE, checked_list
from hexmj.sweep import Cell
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride

OWN = {model_variant: name for name, model_variant in MODEL_VARIANTS.items() if name != "printed"}
"""Readings under which sets of our own were searched -> what their names begin with, instead of 'own'."""

RANGES = {"wide": (0.1, 0.7), "hws again": (0.1, 0.45), "ldvs again": (0.1, 0.5)}
"""Problem 2: sets of the table of found sets -> the range W of their search; 'again' are the paper's two problems, on
the wide one it could not fit a hard-wired system."""


@dataclass(frozen=True)
class Protocol:
    """How much is simulated; the defaults are the paper's."""

    samples: int = 7
    """Samples of starts; their means and deviations make the curves of Figs. 2-4."""
    sample: int = SAMPLE
    """Starts of one sample."""
    velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 19))
    """Velocities of Figs. 2-4, 0.1 to 0.9."""
    gait_starts: int = 100
    """Starts of each gait in Section 5.3."""
    gait_velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 20))
    """Velocities of Figs. 5 and 6, 0.1 to 0.95."""
    footfall_velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.9)
    """Velocities of the footfall diagrams."""
    obstacle_velocities: tuple[float, ...] = (0.3, 0.5, 0.7)
    """Velocities at which Section 6's obstacles are met."""
    obstacle_starts: int = 400
    """Starts that meet each of them."""
    seed: int = 1998
    """Of all starts; another than those of the searches that found the ideal sets."""
    stride: Stride = field(default_factory=Stride)
    """Of the walks whose stability is measured."""
    gait_stride: Stride = field(default_factory=lambda: Stride(dt=0.01))
    """Of the gaits; the time step is that of Figs. 5 and 6."""
    acceleration: Acceleration = field(default_factory=Acceleration)
    """Eq. 11, for the accelerated walks and all gaits."""
    order: Order = "printed"
    """Order of updates of all networks."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """Reading of all networks."""
    looks: Looks = "steps"
    """When it is looked whether a walk is stable (Eq. 7)."""
    margin: float = 0.0
    """By how much S is narrower than ]PEP_0, AEP_0[ at either end [mm]."""

    def __post_init__(self) -> None:
        check_types(self)
        for name in ("velocities", "gait_velocities", "footfall_velocities", "obstacle_velocities"):
            checked_list(getattr(self, name))
        for name in ("samples", "sample", "gait_starts", "obstacle_starts"):
            whole(name, getattr(self, name), 1, MOST_STARTS)
        whole("seed", self.seed, 0)

    def network(self, name: str, observation_time: str, velocity: float) -> Cruse1998 | None:
        """The network of a measurement at a velocity, as this protocol reads it.

        Args:
            name: a preset, 'ideal' (Problem 1) or one of `RANGES` (Problem 2), found under the observation time and this reading,
                or 'own', the preset of our own for this velocity alone.
            observation_time: one of `OBSERVATION_TIMES`.
            velocity: V_r.

        Returns:
            None where no such set is known.
        """
        if name == "ideal":
            found = found_set(observation_time, velocity, model_variant=self.model_variant)
        elif name == "own":
            found = PRESETS.get(f"{OWN.get(self.model_variant, 'own')}-{velocity:g}")
        else:
            found = (
                found_set(observation_time, *RANGES[name], model_variant=self.model_variant)
                if name in RANGES
                else PRESETS[name]
            )
        return found and replace(found, order=self.order, model_variant=self.model_variant)


FULL = Protocol()
"""The paper's: seven times 1000 starts, gaits from 100."""

QUICK = Protocol(
    sample=100,
    velocities=(0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9),
    gait_starts=10,
    gait_velocities=(0.1, 0.25, 0.4, 0.6, 0.8, 0.95),
    gait_stride=Stride(dt=0.05),
    obstacle_velocities=(0.3, 0.7),
    obstacle_starts=20,
)
"""A tenth of the starts, about half of the velocities, gaits with a coarser time step."""


@dataclass(frozen=True)
class Losses:
    """Which starts lose static stability under both observation times: Figs. 2-4."""

    preset: str
    """See `Protocol.network`."""
    accelerated: bool = False
    """Walk with Eq. 11."""
    late: bool = False
    """Look only after five periods of a single leg."""
    function = staticmethod(losses)
    at = "velocities"
    """Field of a protocol: where it is measured."""

    def settings(self, velocity: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on, but for velocity and seed."""
        return {
            "sets": tuple(
                protocol.network(self.preset, observation_time, velocity) for observation_time in OBSERVATION_TIMES
            ),
            "n_starts": protocol.samples * protocol.sample,
            "stride": protocol.stride,
            "acceleration": protocol.acceleration if self.accelerated else None,
            "late": self.late,
            "looks": protocol.looks,
            "margin": protocol.margin,
        }


@dataclass(frozen=True)
class Gaits:
    """The limit regimes of one preset: Figs. 5 and 6 with Eq. 11, or without it as in Section 5.2."""

    preset: str
    accelerated: bool = True
    function = staticmethod(limit_regimes)

    @property
    def at(self) -> str:
        """See `Losses.at`."""
        return "gait_velocities" if self.accelerated else "velocities"

    def settings(self, velocity: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on, but for velocity and seed."""
        return {
            "controller": protocol.network(self.preset, "walk", velocity),
            "n_starts": protocol.gait_starts,
            "stride": protocol.gait_stride if self.accelerated else protocol.stride,
            "acceleration": protocol.acceleration if self.accelerated else None,
        }


@dataclass(frozen=True)
class Footfall:
    """The states of all legs in the accelerated walk of one start, over three periods of its limit regime."""

    preset: str
    function = staticmethod(footfalls)
    at = "footfall_velocities"

    def settings(self, velocity: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on, but for velocity and seed."""
        return {
            "controller": protocol.network(self.preset, "walk", velocity),
            "stride": protocol.stride,
            "acceleration": protocol.acceleration,
        }


@dataclass(frozen=True)
class Obstacles:
    """Which starts lose static stability after an obstacle in mid-stride (Section 6), of one preset."""

    preset: str
    answer: Answer
    function = staticmethod(losses_after)
    at = "obstacle_velocities"

    def settings(self, velocity: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on, but for velocity and seed."""
        return {
            "controller": protocol.network(self.preset, "walk", velocity),
            "answer": self.answer,
            "n_starts": protocol.obstacle_starts,
            "stride": protocol.stride,
            "acceleration": protocol.acceleration if self.answer == "slow down" else None,
        }


Measurement = Losses | Gaits | Footfall | Obstacles

MEASUREMENTS: dict[str, Measurement] = {
    "uncoordinated": Losses("uncoordinated"),
    "hws": Losses("hws"),
    "ldvs": Losses("ldvs"),
    "ideal": Losses("ideal"),
    "wide": Losses("wide"),
    "hws again": Losses("hws again"),
    "ldvs again": Losses("ldvs again"),
    "own": Losses("own"),
    "hws late": Losses("hws", late=True),
    "ldvs late": Losses("ldvs", late=True),
    "ideal late": Losses("ideal", late=True),
    "own late": Losses("own", late=True),
    "hws accelerated": Losses("hws", accelerated=True),
    "ldvs accelerated": Losses("ldvs", accelerated=True),
    "hws regimes": Gaits("hws", accelerated=False),
    "ldvs regimes": Gaits("ldvs", accelerated=False),
    "hws gaits": Gaits("hws"),
    "ldvs gaits": Gaits("ldvs"),
    "hws footfall": Footfall("hws"),
    "ldvs footfall": Footfall("ldvs"),
    "ldvs halted": Obstacles("ldvs", "none"),
    "ldvs halted, positions": Obstacles("ldvs", "positions"),
    "ldvs halted, postures": Obstacles("ldvs", "postures"),
    "ldvs halted, slows down": Obstacles("ldvs", "slow down"),
}
"""All that is simulated, by name."""

SECONDS = {
    "hws accelerated": 25.0, "ldvs accelerated": 25.0, "hws gaits": 80.0, "ldvs gaits": 80.0,
    "hws late": 5.0, "ldvs late": 5.0, "hws regimes": 7.0, "ldvs regimes": 7.0, "ideal late": 5.0, "own late": 3.0,
    "ldvs halted, positions": 4.0, "ldvs halted, postures": 4.0, "ldvs halted, slows down": 12.0,
}  # fmt: skip
"""That the long ones take on two cores, for the progress bar; the others take about one."""


def velocities_of(name: str, protocol: Protocol) -> tuple[float, ...]:
    """Where one of `MEASUREMENTS` is taken."""
    return getattr(protocol, MEASUREMENTS[name].at)


def cells(name: str, protocol: Protocol) -> list[Cell]:
    """One of `MEASUREMENTS`, a cell for each velocity.

    Raises:
        InputError: no such measurement.
    """
    if name not in MEASUREMENTS:
        raise InputError(f"measurement {name!r:.80}; valid names: {', '.join(MEASUREMENTS)}")
    measurement, velocities = MEASUREMENTS[name], velocities_of(name, protocol)
    work = SECONDS.get(name, 1.0) / len(velocities)

    def cell(v: float) -> Cell:
        told = {"velocity": v, "seed": protocol.seed} | measurement.settings(v, protocol)
        return Cell(f"{name} {v:g}", measurement.function, told, work)

    return [cell(v) for v in velocities]
