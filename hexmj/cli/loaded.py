"""The controllers of a command, as it has loaded them first."""

from contextlib import suppress
from typing import Any

from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.sweeps.plain_settings import plain

LOADED: dict[str, tuple[Controller, Any]] = {}
"""Controllers as the command has loaded them, and their settings then: a file that is edited while it runs is not run
again."""


def loaded(name: str) -> Controller:
    """A controller by its name as the command has loaded it first; names and errors as of `load_controller`."""
    from hexmj.controllers.named import load_controller

    if name not in LOADED:
        LOADED[name] = (found := load_controller(name)), _settings(found)
    return LOADED[name][0]


def _settings(controller: Controller) -> Any:
    """A controller's settings as plain data; none where they are no such."""
    with suppress(InputError):
        return plain(controller)


def check_loaded() -> None:
    """Refuse that a file has changed, while the command was at work, which a field of a controller names.

    Raises:
        InputError: it has, or settings are none any more.
    """
    for name, (controller, settings) in LOADED.items():
        if settings is not None and plain(controller) != settings:
            raise InputError(f"a file that {name} names has changed while the command was at work; start it again")
