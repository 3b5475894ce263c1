"""Errors that hexmj raises."""

from collections.abc import Mapping
from typing import Any


class InputError(ValueError):
    """An argument, option or file that makes no sense; the message names it, its value and what is expected."""


class OutOfReach(InputError):
    """A plan whose tips a body cannot reach."""


class Refused(InputError):
    """A controller that does not walk with its settings, at a velocity or with a time step."""


class StillThrown(InputError):
    """A walk that ends while a push still acts, so that its outcome is unknown."""


class SimulationError(RuntimeError):
    """A physical simulation that did not settle or diverged. It is never counted as an outcome."""

    def __init__(self, message: str, state: Mapping[str, Any] | None = None) -> None:
        """Keep the last finite state, if it is known."""
        super().__init__(message, state)
        self.message, self.state = message, dict(state or {})

    def __str__(self) -> str:
        return self.message


class RenderingError(RuntimeError):
    """A film that cannot be rendered on this machine; the message names the missing package."""


def without_extra(extra: str, library: str) -> InputError:
    """Return the error for a missing optional library; it names the extra that installs it."""
    return InputError(f"{library} is not installed; in a checkout of hexmj: pip install '.[{extra}]'")
