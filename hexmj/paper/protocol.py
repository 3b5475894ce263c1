"""What Section 5 simulates: measurements, each of a few seconds at one velocity, from which the claims are judged."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from hexmj.controllers.cruse1998 import MODEL_VARIANTS, PRESETS, Cruse1998, ModelVariant, Order
from hexmj.paper.found_sets import found_set
from hexmj.paper.measurements import Answer, footfalls, limit_regimes, losses, losses_after
from hexmj.starts import MOST_STARTS, SAMPLE, checked_list
from hexmj.sweep import Cell
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride
from hexmj.validate import choice, whole

OWN = {variant: name for name, variant in MODEL_VARIANTS.items() if name != "printed"}
"""Model variants under which our own presets were searched -> beginning of their names, instead of 'own'."""

RANGES = {"wide": (0.1, 0.7), "hws again": (0.1, 0.45), "ldvs again": (0.1, 0.5)}
"""Problem 2: found sets -> the range W of their search. 'again' are the paper's two problems; on the wide range the
paper could not fit a hard-wired system."""


@dataclass(frozen=True)
class Protocol:
    """How much is simulated; the defaults are the paper's."""

    samples: int = 7
    """Samples of starts; the curves of Figs. 2-4 are their means and standard deviations."""
    sample: int = SAMPLE
    """Starts of one sample."""
    velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 19))
    """Velocities of Figs. 2-4, 0.1 to 0.9 [V_p]."""
    gait_starts: int = 100
    """Starts of each gait in Section 5.3."""
    gait_velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 20))
    """Velocities of Figs. 5 and 6, 0.1 to 0.95 [V_p]."""
    footfall_velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.9)
    """Velocities of the footfall diagrams [V_p]."""
    obstacle_velocities: tuple[float, ...] = (0.3, 0.5, 0.7)
    """Velocities at which Section 6's obstacles are met [V_p]."""
    obstacle_starts: int = 400
    """Starts that meet each obstacle."""
    seed: int = 1998
    """Seed of all starts; the ideal sets were searched with 0 and 1."""
    stride: Stride = field(default_factory=Stride)
    """Step range and time step of the walks whose stability is measured."""
    gait_stride: Stride = field(default_factory=lambda: Stride(dt=0.01))
    """Step range and time step of the gaits, as in Figs. 5 and 6."""
    acceleration: Acceleration = field(default_factory=Acceleration)
    """Eq. 11, for the accelerated walks and all gaits."""
    order: Order = "printed"
    """Order of updates of all networks."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """Model variant of all networks."""

    def __post_init__(self) -> None:
        for name in ("velocities", "gait_velocities", "footfall_velocities", "obstacle_velocities"):
            checked_list(getattr(self, name))
        for name in ("samples", "sample", "gait_starts", "obstacle_starts"):
            whole(name, getattr(self, name), 1, MOST_STARTS)
        whole("seed", self.seed, 0)

    def network(self, name: str, observation_time: str, velocity: float) -> Cruse1998 | None:
        """Return the network of a measurement, with this protocol's order and model variant; None if none is known.

        Args:
            name: a preset; 'ideal' (Problem 1) or one of `RANGES` (Problem 2), as found for the observation time and
                model variant; or 'own', our own preset for this velocity alone.
            observation_time: 'walk' or 'start'.
            velocity: V_r, a fraction of V_p.
        """
        if name == "own":
            found = PRESETS.get(f"{OWN.get(self.model_variant, 'own')}-{velocity:g}")
        elif name == "ideal" or name in RANGES:
            velocities = RANGES.get(name, (velocity, velocity))
            found = found_set(observation_time, *velocities, model_variant=self.model_variant)
        else:
            found = PRESETS[name]
        return found and replace(found, order=self.order, model_variant=self.model_variant)


FULL = Protocol()
"""The paper's protocol: seven times 1000 starts, gaits from 100."""

QUICK = Protocol(
    sample=100,
    velocities=(0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9),
    gait_starts=10,
    gait_velocities=(0.1, 0.25, 0.4, 0.6, 0.8, 0.95),
    gait_stride=Stride(dt=0.05),
    obstacle_velocities=(0.3, 0.7),
    obstacle_starts=20,
)
"""A tenth of the starts, about half of the velocities, and gaits with a coarser time step."""


@dataclass(frozen=True)
class Reproduction:
    """What `hexmj reproduce` judges."""

    quick: bool = False
    """Fewer starts and velocities, and coarser steps of gaits: under a minute. The full protocol takes several."""
    only: tuple[str, ...] = ()
    """Keys of the claims to judge, without figures; by default all."""
    beside: tuple[str, ...] = ()
    """Model variants of the network under which the claims are judged too, such as 'lasting'."""
    seed: int = FULL.seed
    """Seed of the random starts; the ideal sets were searched with 0 and 1."""

    @property
    def protocol(self) -> Protocol:
        """How much is simulated."""
        return replace(QUICK if self.quick else FULL, seed=self.seed)


@dataclass(frozen=True)
class Measurement:
    """A function of one velocity, and where it is measured."""

    function: Callable[..., Any]
    at: str
    """Field of a protocol that holds the velocities."""
    settings: Callable[[float, Protocol], dict[str, Any]]
    """Arguments of the function besides velocity and seed, from a velocity and a protocol."""
    seconds: float = 1.0
    """Time on two cores, for the progress bar [s]."""


def _losses(preset: str, seconds: float = 1.0, *, accelerated: bool = False, late: bool = False) -> Measurement:
    """Return the losses under both observation times: Figs. 2-4."""

    def settings(velocity: float, protocol: Protocol) -> dict[str, Any]:
        return {
            "sets": tuple(protocol.network(preset, time, velocity) for time in OBSERVATION_TIMES),
            "n_starts": protocol.samples * protocol.sample,
            "stride": protocol.stride,
            "acceleration": protocol.acceleration if accelerated else None,
            "late": late,
        }

    return Measurement(losses, "velocities", settings, seconds)


def _gaits(preset: str, seconds: float, *, accelerated: bool = True) -> Measurement:
    """Return the steady-state gaits: Figs. 5 and 6 with Eq. 11, or without it as in Section 5.2."""

    def settings(velocity: float, protocol: Protocol) -> dict[str, Any]:
        return {
            "controller": protocol.network(preset, "walk", velocity),
            "n_starts": protocol.gait_starts,
            "stride": protocol.gait_stride if accelerated else protocol.stride,
            "acceleration": protocol.acceleration if accelerated else None,
        }

    return Measurement(limit_regimes, "gait_velocities" if accelerated else "velocities", settings, seconds)


def _footfalls(preset: str) -> Measurement:
    """Return the stances in the accelerated walk of one start."""

    def settings(velocity: float, protocol: Protocol) -> dict[str, Any]:
        network = protocol.network(preset, "walk", velocity)
        return {"controller": network, "stride": protocol.stride, "acceleration": protocol.acceleration}

    return Measurement(footfalls, "footfall_velocities", settings)


def _obstacles(preset: str, answer: Answer, seconds: float = 1.0) -> Measurement:
    """Return the losses after an obstacle in mid-stride (Section 6)."""

    def settings(velocity: float, protocol: Protocol) -> dict[str, Any]:
        return {
            "controller": protocol.network(preset, "walk", velocity),
            "answer": answer,
            "n_starts": protocol.obstacle_starts,
            "stride": protocol.stride,
            "acceleration": protocol.acceleration if answer == "slow down" else None,
        }

    return Measurement(losses_after, "obstacle_velocities", settings, seconds)


MEASUREMENTS: dict[str, Measurement] = {
    **{name: _losses(name) for name in ("uncoordinated", "hws", "ldvs", "ideal", *RANGES, "own")},
    "hws late": _losses("hws", 5.0, late=True),
    "ldvs late": _losses("ldvs", 5.0, late=True),
    "ideal late": _losses("ideal", 5.0, late=True),
    "own late": _losses("own", 3.0, late=True),
    "hws accelerated": _losses("hws", 25.0, accelerated=True),
    "ldvs accelerated": _losses("ldvs", 25.0, accelerated=True),
    "hws regimes": _gaits("hws", 7.0, accelerated=False),
    "ldvs regimes": _gaits("ldvs", 7.0, accelerated=False),
    "hws gaits": _gaits("hws", 80.0),
    "ldvs gaits": _gaits("ldvs", 80.0),
    "hws footfall": _footfalls("hws"),
    "ldvs footfall": _footfalls("ldvs"),
    "ldvs halted": _obstacles("ldvs", "none"),
    "ldvs halted, positions": _obstacles("ldvs", "positions", 4.0),
    "ldvs halted, postures": _obstacles("ldvs", "postures", 4.0),
    "ldvs halted, slows down": _obstacles("ldvs", "slow down", 12.0),
}
"""All measurements by name."""


def cells(name: str, protocol: Protocol) -> dict[float, Cell]:
    """Return the cells of a measurement by velocity.

    Raises:
        InputError: no such measurement.
    """
    measurement = MEASUREMENTS[choice("measurement", name, MEASUREMENTS)]
    velocities: tuple[float, ...] = getattr(protocol, measurement.at)
    work = measurement.seconds / len(velocities)

    def cell(v: float) -> Cell:
        settings = {"velocity": v, "seed": protocol.seed} | measurement.settings(v, protocol)
        return Cell(f"{name} {v:g}", measurement.function, settings, work)

    return {v: cell(v) for v in velocities}
