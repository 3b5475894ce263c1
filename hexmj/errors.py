"""Errors that hexmj raises."""

from collections.abc import Mapping
from typing import Any


class InputError(ValueError):
    """Raised if an argument, option or file is invalid; the message says its name, its value and what is allowed."""


class OutOfReach(InputError):
    """Raised if foot targets of a plan are out of the body's reach."""


class Refused(InputError):
    """Raised if a controller cannot walk with its settings, the velocity or the time step."""


class StillThrown(InputError):
    """Raised if a walk ends while its start is still thrown by a push, so that the outcome is unknown."""


class SimulationError(RuntimeError):
    """Raised if a physical simulation does not settle, or diverges; it never counts as an outcome."""

    def __init__(self, message: str, state: Mapping[str, Any] | None = None) -> None:
        """Store the message and the last finite state, if it is known."""
        super().__init__(message, state)
        self.message, self.state = message, dict(state or {})

    def __str__(self) -> str:
        return self.message


class RenderingError(RuntimeError):
    """Raised if this machine cannot render a film; the message names the missing package."""


def without_extra(extra: str, library: str) -> InputError:
    """Return the InputError for a missing library, which names the extra of hexmj that installs it."""
    return InputError(f"{library} is not installed; in a checkout of hexmj: pip install '.[{extra}]'")
