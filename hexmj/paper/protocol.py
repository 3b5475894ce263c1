"""The measurements of Sections 5 and 6, from which claims are judged, their numbers of starts and velocities."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998 import MODEL_VARIANTS, PRESETS, Cruse1998, ModelVariant, Order, Symmetric
from hexmj.files import read_toml
from hexmj.paper.measurements import limit_regimes, losses, losses_after
from hexmj.starts import SAMPLE
from hexmj.sweep import Cell
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride

PRINTED = MODEL_VARIANTS["printed"]  # the rules as the paper prints them

FOUND = Path(__file__).with_name("ideal.toml")
"""File with the weight sets that searches found."""

OWN = {variant: name for name, variant in MODEL_VARIANTS.items() if name != "printed"}
"""Model variant under which our own presets were searched -> prefix of their names, instead of 'own'."""

RANGES = {"wide": (0.1, 0.7), "hws again": (0.1, 0.45), "ldvs again": (0.1, 0.5)}
"""Name of a weight set found for Problem 2 -> the velocity range W of its search. The sets 'again' repeat the paper's
two searches. On the range of 'wide', the paper found no good hard-wired set."""

Place = tuple[str, float, float, ModelVariant]
"""Key of a found weight set: observation time, lowest and highest velocity, and model variant of its search."""


@cache
def found_sets(path: Path = FOUND) -> dict[Place, Cruse1998]:
    """Return the networks of all found weight sets; in Problem 1 the lowest velocity is the highest too."""
    found = {}
    for entry in read_toml(path)["set"]:
        velocities, time = entry["velocities"], entry["observation_time"]
        model_variant = MODEL_VARIANTS[entry.get("model_variant", "printed")]
        weights = Symmetric(**{name: float(value) for name, value in entry["symmetric"].items()})
        name = f"ideal for {time}, V = {' to '.join(map(str, velocities))}"
        place = time, velocities[0], velocities[-1], model_variant
        found[place] = Cruse1998(weights, name=name, model_variant=model_variant)
    return found


def searched_seeds() -> set[int]:
    """Return the seeds of the searches that found the weight sets of `FOUND`."""
    return {entry["seed"] for entry in read_toml(FOUND)["set"]}


@dataclass(frozen=True)
class Protocol:
    """Numbers of starts, velocities and further settings of all measurements; by default those of the paper."""

    samples: int = 7
    """Number of samples of starts, whose means and standard deviations are the curves of Figs. 2-4."""
    sample: int = SAMPLE
    """Number of starts in one sample."""
    velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 19))
    """Velocities of Figs. 2-4, 0.1 to 0.9 [V_p]."""
    gait_starts: int = 100
    """Number of starts for the gaits of Section 5.3, at each velocity."""
    gait_velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 20))
    """Velocities of Figs. 5 and 6, 0.1 to 0.95 [V_p]."""
    obstacle_velocities: tuple[float, ...] = (0.3, 0.5, 0.7)
    """Velocities of the walks that meet an obstacle (Section 6) [V_p]."""
    obstacle_starts: int = 400
    """Number of starts that meet an obstacle, at each velocity."""
    seed: int = 1998
    """Seed of all starts. The ideal sets were searched with seeds 0 and 1, for which their FLSS is too low."""
    stride: Stride = field(default_factory=Stride)
    """Step range and time step of walks for FLSS."""
    gait_stride: Stride = field(default_factory=lambda: Stride(dt=0.01))
    """Step range and time step of walks for the steady-state gaits of Figs. 5 and 6."""
    acceleration: Acceleration = field(default_factory=Acceleration)
    """Acceleration by Eq. 11, in accelerated walks, in walks for gaits and after obstacles with 'slow down'."""
    order: Order = "printed"
    """Order of updates in all networks."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """Model variant of all networks."""

    def network(self, name: str, observation_time: str, velocity: float) -> Cruse1998 | None:
        """Return a network with this protocol's order and model variant; None if its weights were not searched yet.

        Args:
            name: name of a preset; 'ideal' (Problem 1) or a key of `RANGES` (Problem 2), for the set found with this
                observation time and model variant; or 'own', for our own preset for this velocity alone.
            observation_time: 'walk' or 'start'.
            velocity: V_r as a fraction of V_p.
        """
        if name == "own":
            found = PRESETS.get(f"{OWN.get(self.model_variant, 'own')}-{velocity:g}")
        elif name == "ideal" or name in RANGES:
            velocities = RANGES.get(name, (velocity, velocity))
            found = found_sets().get((observation_time, *velocities, self.model_variant))
        else:
            found = PRESETS[name]
        return found and replace(found, order=self.order, model_variant=self.model_variant)


FULL = Protocol()
"""The paper's protocol: seven samples of 1000 starts, and gaits from 100 starts."""

QUICK = Protocol(
    sample=100,
    velocities=(0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9),
    gait_starts=10,
    gait_velocities=(0.1, 0.25, 0.4, 0.6, 0.8, 0.95),
    gait_stride=Stride(dt=0.05),
    obstacle_velocities=(0.3, 0.7),
    obstacle_starts=20,
)
"""Protocol with a tenth of the starts, about half of the velocities, and a coarser time step for gaits."""


@dataclass(frozen=True)
class Measurement:
    """A function that measures at one velocity, its further arguments, and the velocities at which it is called."""

    function: Callable[..., Any]
    """Function: `losses` (Figs. 2-4), `limit_regimes` (Figs. 5, 6) or `losses_after` (Section 6)."""
    at: str
    """Name of the field of `Protocol` that holds the velocities."""
    preset: str
    """Name of the network, see `Protocol.network`."""
    seconds: float = 1.0
    """Computing time at all velocities of `FULL` on two cores [s], the work of its cells."""
    accelerated: bool = False
    """Whether walks accelerate by Eq. 11."""
    own: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments of the function, such as `late`."""

    def settings(self, velocity: float, protocol: Protocol) -> dict[str, Any]:
        """Return all arguments of the function except velocity and seed."""
        networks = [protocol.network(self.preset, time, velocity) for time in OBSERVATION_TIMES]
        starts: dict[Any, int] = {losses: protocol.samples * protocol.sample, limit_regimes: protocol.gait_starts}
        return {
            **({"sets": tuple(networks)} if self.function is losses else {"controller": networks[0]}),
            "n_starts": starts.get(self.function, protocol.obstacle_starts),
            "stride": protocol.gait_stride if self.at == "gait_velocities" else protocol.stride,
            "acceleration": protocol.acceleration if self.accelerated else None,
            **self.own,
        }


_losses = partial(Measurement, losses, "velocities")
_obstacles = partial(Measurement, losses_after, "obstacle_velocities", "ldvs")

MEASUREMENTS: dict[str, Measurement] = {
    **{name: _losses(name) for name in ("uncoordinated", "hws", "ldvs", "ideal", *RANGES, "own")},
    **{f"{name} late": _losses(name, 5.0, own={"late": True}) for name in ("hws", "ldvs", "ideal", "own")},
    **{f"{name} accelerated": _losses(name, 25.0, accelerated=True) for name in ("hws", "ldvs")},
    **{f"{name} regimes": Measurement(limit_regimes, "velocities", name, 7.0) for name in ("hws", "ldvs")},
    **{f"{name} gaits": Measurement(limit_regimes, "gait_velocities", name, 80.0, True) for name in ("hws", "ldvs")},
    "ldvs halted": _obstacles(own={"answer": "none"}),
    "ldvs halted, positions": _obstacles(4.0, own={"answer": "positions"}),
    "ldvs halted, postures": _obstacles(4.0, own={"answer": "postures"}),
    "ldvs halted, slows down": _obstacles(12.0, accelerated=True, own={"answer": "slow down"}),
}
"""Name of each measurement -> its function and settings."""


def cells(name: str, protocol: Protocol) -> dict[float, Cell]:
    """Return the cell (see `sweep.Cell`) of a measurement at each of its velocities, by velocity."""
    measurement, found = MEASUREMENTS[name], {}
    for v in getattr(protocol, measurement.at):
        settings = {"velocity": v, "seed": protocol.seed} | measurement.settings(v, protocol)
        work = measurement.seconds / len(getattr(FULL, measurement.at))
        found[v] = Cell(f"{name} {v:g}", measurement.function, settings, work)
    return found
