"""The controllers of a command, as it has loaded them first."""

from contextlib import suppress
from typing import Any, NamedTuple

from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.sweeps.plain_settings import plain


class Loaded(NamedTuple):
    """What a command has loaded by a name, as it was then: a file that is edited meanwhile is not read again."""

    controller: Controller
    settings: Any
    """None where they are no plain data."""
    searched: dict[str, list[int]]
    """See `searched_on`."""


LOADED: dict[str, Loaded] = {}
"""By the names by which they were asked for."""


def loaded(name: str) -> Controller:
    """A controller by its name as the command has loaded it first; names and errors as of `load_controller`."""
    return _loaded(name).controller


def seeds_of_searches(name: str) -> dict[str, list[int]]:
    """What searches have found of it; see `searched_on`."""
    return _loaded(name).searched


def _loaded(name: str) -> Loaded:
    from hexmj.controllers.named import load_controller
    from hexmj.controllers.searched import searched_on

    if name not in LOADED:
        found = load_controller(name)
        LOADED[name] = Loaded(found, _settings(found), searched_on(name, found))
    return LOADED[name]


def _settings(controller: Controller) -> Any:
    """A controller's settings as plain data; none where they are no such."""
    with suppress(InputError):
        return plain(controller)


def check_loaded() -> None:
    """Refuse that a file has changed, while the command was at work, which a field of a controller names.

    Raises:
        InputError: it has, or settings are none any more.
    """
    for name, one in LOADED.items():
        if one.settings is not None and plain(one.controller) != one.settings:
            raise InputError(f"a file that {name} names has changed while the command was at work; start it again")
