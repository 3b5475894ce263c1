"""Short names of controllers that were named by files: no longer than what tells them apart."""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import PurePath

from hexmj.controllers.named import known_names
from hexmj.controllers.protocol import Controller
from hexmj.controllers.varied_names import VARIED

LONGEST = 24
"""Letters of a name that a controller gives itself, at most."""


def short_names(found: Mapping[str, Controller]) -> dict[str, str]:
    """How controllers are called in tables and figures, all differently: presets, rivals and entry points as they were
    asked for, others as they call themselves, or by as much of their file's name as it takes.

    Args:
        found: controllers by the names that `load_controller` was given.
    """
    known = {*known_names()}
    rungs = {name: [*_rungs(name, one, known)] for name, one in found.items()}
    step = dict.fromkeys(rungs, 0)
    while True:
        shown = {name: rungs[name][step[name]] for name in rungs}
        often = Counter(shown.values())
        longer = [name for name in shown if often[shown[name]] > 1 and step[name] + 1 < len(rungs[name])]
        if not longer:
            return shown
        for name in longer:
            step[name] += 1


def _rungs(name: str, controller: Controller, known: set[str]) -> Iterator[str]:
    """Longer and longer names, at last that which was asked for."""
    varied = VARIED.fullmatch(name)
    if (varied["name"] if varied else name) not in known:
        own = controller.name
        if own not in known and len(own) <= LONGEST and own.isprintable() and "|" not in own:
            yield own
        where, colon, what = name.rpartition(":")
        parts = PurePath(where if colon else name).parts
        for first in range(len(parts) - 1, 0, -1):
            yield "/".join(parts[first:]) + (f":{what}" if colon else "")
    yield name
