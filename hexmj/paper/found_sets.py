"""The weight sets that searches found (`ideal.toml`), by observation time and velocities."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hexmj.controllers.cruse1998 import MODEL_VARIANTS, Cruse1998, ModelVariant, Symmetric
from hexmj.files import read_toml

TABLE = Path(__file__).with_name("ideal.toml")
PRINTED = MODEL_VARIANTS["printed"]


@dataclass(frozen=True)
class FoundSet:
    """A weight set and what it was searched for."""

    observation_time: str
    """'walk' or 'start'."""
    low: float
    """Least velocity of the search."""
    high: float
    """Greatest velocity; the least one for Problem 1."""
    controller: Cruse1998
    seed: int
    """Seed of the search and its starts."""

    @property
    def place(self) -> tuple[str, float, float, ModelVariant]:
        """Observation time, velocities and model variant, which are different for all sets."""
        return self.observation_time, self.low, self.high, self.controller.model_variant


@cache
def found_sets(path: Path = TABLE) -> tuple[FoundSet, ...]:
    """Return all sets of a table."""
    found = []
    for entry in read_toml(path)["set"]:
        velocities, time = entry["velocities"], entry["observation_time"]
        weights = Symmetric(**{name: float(value) for name, value in entry["symmetric"].items()})
        name = f"ideal for {time}, V = {' to '.join(map(str, velocities))}"
        model_variant = MODEL_VARIANTS[entry.get("model_variant", "printed")]
        controller = Cruse1998(weights, name=name, model_variant=model_variant)
        found.append(FoundSet(time, velocities[0], velocities[-1], controller, entry["seed"]))
    return tuple(found)


def found_set(
    observation_time: str, low: float, high: float | None = None, model_variant: ModelVariant = PRINTED
) -> Cruse1998 | None:
    """Return the set for one velocity (Problem 1) or a range (Problem 2); None if there is none."""
    place = observation_time, low, low if high is None else high, model_variant
    return next((one.controller for one in found_sets() if one.place == place), None)
