"""What can go wrong, each with one clear sentence."""

from collections.abc import Mapping, Sequence
from traceback import extract_tb
from typing import Any

LONGEST = 1000
"""Characters of a sentence; what was given may be longer, and is shown in part."""


class InputError(Exception):
    """A value that makes no sense: says what was given, what is expected and the valid names."""

    def __str__(self) -> str:
        sentence = super().__str__()
        return sentence if len(sentence) <= LONGEST else f"{sentence[: LONGEST // 2]} [...] {sentence[-LONGEST // 2 :]}"


class OutOfReach(InputError):
    """A plan whose tips a body cannot reach, so that it does not walk."""


class Refused(InputError):
    """A controller that does not walk with its values, at a velocity or with a time step."""


class StillThrown(InputError):
    """A walk that a push still throws as it ends, so that nobody knows whether it falls."""


class SimulationError(RuntimeError):
    """A physical simulation that did not settle or diverged; it is never counted as an outcome, and by it a
    candidate of a search costs as much as one that refuses to walk."""

    def __init__(self, sentence: str, state: Mapping[str, Any] | None = None, file_name: str = "") -> None:
        """What happened, and the last good state, if it is known, with a name for its file."""
        super().__init__(sentence, state, file_name)
        self.sentence, self.state, self.file_name = sentence, dict(state or {}), file_name

    def __str__(self) -> str:
        return self.sentence


class RenderingError(RuntimeError):
    """No video can be rendered on this machine; names the package that brings it."""


def without_extra(extra: str, library: str) -> InputError:
    """What to say where an optional library is not installed, and the extra that brings it."""
    return InputError(f'{library} is not installed; in a checkout of hexmj: pip install ".[{extra}]"')


def is_of_numbas_cache(error: BaseException) -> bool:
    """Whether an error comes from where numba keeps and finds compiled code."""
    return any(frame.filename.endswith("caching.py") for frame in extract_tb(error.__traceback__))


def check_distinct(name: str, values: Sequence[object]) -> None:
    """Refuse a list, such as one of conditions that are varied, that is empty or holds a value twice.

    Raises:
        InputError: with the list's `name` and its values.
    """
    if not values or len(set(values)) < len(values):
        raise InputError(f"{name} = {list(values)}; expected at least one, and none of them twice")
