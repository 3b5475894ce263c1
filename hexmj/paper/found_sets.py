"""The parameter sets that searches found (``ideal.toml``), by observation time and velocities."""

from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998 import MODEL_VARIANTS, Cruse1998, ModelVariant, Symmetric
from hexmj.controllers.cruse1998.model_variants import named_variant
from hexmj.errors import InputError
from hexmj.files import read_toml
from hexmj.timing import OBSERVATION_TIMES

TABLE = Path(__file__).with_name("ideal.toml")
PRINTED = MODEL_VARIANTS["printed"]

SEARCH_SEEDS = 0, 1
"""Seeds of the starts on which they were searched."""


@dataclass(frozen=True)
class FoundSet:
    """One set of the HWS form, or for a range of the LDVS form, with what found it."""

    observation_time: str
    """Observation time under which it was searched, 'walk' or 'start'."""
    low: float
    """Least velocity of the search."""
    high: float
    """Greatest velocity; the least again for Problem 1."""
    controller: Cruse1998
    command: str
    """Finds it again, with its seed."""

    @property
    def place(self) -> tuple[str, float, float, ModelVariant]:
        """What it was searched for; no two sets of a table have the same."""
        return self.observation_time, self.low, self.high, self.controller.model_variant


@cache
def found_sets(path: Path = TABLE) -> tuple[FoundSet, ...]:
    """All sets of a table.

    Raises:
        InputError: the table is damaged, or holds a set twice.
    """
    table = read_toml(path)
    found = tuple(_read(entry, f"{path.name}, set {i + 1}") for i, entry in enumerate(table.get("set", [])))
    places = [one.place for one in found]
    if twice := [place for place in places if places.count(place) > 1]:
        raise InputError(
            f"{path.name} holds two sets for {twice[0]}; expected one for each observation time and velocity"
        )
    return found


def found_set(
    observation_time: str, low: float, high: float | None = None, model_variant: ModelVariant = PRINTED
) -> Cruse1998 | None:
    """The set for one velocity (Problem 1) or a range (Problem 2); None where no search has been made yet."""
    place = observation_time, low, low if high is None else high, model_variant
    return next((one.controller for one in found_sets() if one.place == place), None)


def _read(entry: dict[str, Any], where: str) -> FoundSet:
    if unknown := set(entry) - {"model_variant"} ^ {"observation_time", "velocities", "command", "symmetric"}:
        raise InputError(f"{where}: {min(unknown)} is missing or unknown; see the head of the file")
    if entry["observation_time"] not in OBSERVATION_TIMES:
        raise InputError(
            f"{where}: observation time = {entry['observation_time']!r}; valid names: {', '.join(OBSERVATION_TIMES)}"
        )
    velocities = entry["velocities"]
    if not (len(velocities) in (1, 2) and all(0 < v < 1 for v in velocities) and velocities == sorted(velocities)):
        raise InputError(f"{where}: velocities = {velocities}; expected one, or the ends of a range, in ]0, 1[")
    form, without = ("HWS", {"p34_i"}) if len(velocities) == 1 else ("LDVS", set())
    names = {f.name for f in fields(Symmetric)} - without
    if unknown := set(entry["symmetric"]) - names:
        valid = ", ".join(sorted(names))
        raise InputError(f"{where}: {min(unknown)} is no parameter of the {form} form; valid: {valid}")
    weights = Symmetric(**{name: float(value) for name, value in entry["symmetric"].items()})
    name = f"ideal for {entry['observation_time']}, V = {' to '.join(map(str, velocities))}"
    controller = Cruse1998(weights, name=name, model_variant=named_variant(entry.get("model_variant", "printed")))
    return FoundSet(entry["observation_time"], velocities[0], velocities[-1], controller, entry["command"])
