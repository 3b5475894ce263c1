"""The parameter sets that searches found (``ideal.toml``), by observation time and velocities."""

from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998 import READINGS, Cruse1998, Reading, Symmetric
from hexmj.controllers.cruse1998.readings import named_reading
from hexmj.errors import InputError
from hexmj.storage.files import read_toml
from hexmj.timing import WINDOWS

TABLE = Path(__file__).with_name("ideal.toml")
PRINTED = READINGS["printed"]

SEARCH_SEEDS = 0, 1
"""Seeds of the starts on which they were searched."""


@dataclass(frozen=True)
class FoundSet:
    """One set of the HWS form, or for a range of the LDVS form, with what found it."""

    window: str
    """Observation time under which it was searched, 'walk' or 'start'."""
    low: float
    """Least velocity of the search."""
    high: float
    """Greatest velocity; the least again for Problem 1."""
    controller: Cruse1998
    command: str
    """Finds it again, with its seed."""

    @property
    def place(self) -> tuple[str, float, float, Reading]:
        """What it was searched for; no two sets of a table have the same."""
        return self.window, self.low, self.high, self.controller.reading


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
        raise InputError(f"{path.name} holds two sets for {twice[0]}; expected one for each window and velocity")
    return found


def found_set(window: str, low: float, high: float | None = None, reading: Reading = PRINTED) -> Cruse1998 | None:
    """The set for one velocity (Problem 1) or a range (Problem 2); None where no search has been made yet."""
    place = window, low, low if high is None else high, reading
    return next((one.controller for one in found_sets() if one.place == place), None)


def _read(entry: dict[str, Any], where: str) -> FoundSet:
    if unknown := set(entry) - {"reading"} ^ {"window", "velocities", "command", "symmetric"}:
        raise InputError(f"{where}: {min(unknown)} is missing or unknown; see the head of the file")
    if entry["window"] not in WINDOWS:
        raise InputError(f"{where}: window = {entry['window']!r}; valid names: {', '.join(WINDOWS)}")
    velocities = entry["velocities"]
    if not (len(velocities) in (1, 2) and all(0 < v < 1 for v in velocities) and velocities == sorted(velocities)):
        raise InputError(f"{where}: velocities = {velocities}; expected one, or the ends of a range, in ]0, 1[")
    form, without = ("HWS", {"p34_i"}) if len(velocities) == 1 else ("LDVS", set())
    names = {f.name for f in fields(Symmetric)} - without
    if unknown := set(entry["symmetric"]) - names:
        valid = ", ".join(sorted(names))
        raise InputError(f"{where}: {min(unknown)} is no parameter of the {form} form; valid: {valid}")
    weights = Symmetric(**{name: float(value) for name, value in entry["symmetric"].items()})
    name = f"ideal for {entry['window']}, V = {' to '.join(map(str, velocities))}"
    controller = Cruse1998(weights, name=name, reading=named_reading(entry.get("reading", "printed")))
    return FoundSet(entry["window"], velocities[0], velocities[-1], controller, entry["command"])
