"""The words behind `hexmj`: which can be read, which decide what comes of a command, and what files they name."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from os.path import isfile
from pathlib import Path
from types import MappingProxyType
from typing import get_args

from hexmj.errors import LONGEST, InputError
from hexmj.storage.files import digest_of, read_toml
from hexmj.storage.literal import literal

INDIFFERENT = {"--out": 1, "--threads": 1, "--processes": 1, "--scheduler": 1, "--range-of": 1, "--json": 0}
"""Options on which no number depends -> how many words follow them."""

NO_TOML = (".py", ".nc")
"""How files end that are no controller's TOML, which may have any name."""

SHELLS = ("bash", "zsh", "fish")
"""Shells that can be told how the command goes on."""

EMPTY = re.compile("--[^=]*=")
"""An option whose value is empty, as one that a shell's variable should have told."""

_TYPED: ContextVar[Sequence[str]] = ContextVar("typed", default=())
_OWN: ContextVar[Mapping[Path, str]] = ContextVar("own", default=MappingProxyType({}))


def checked(words: list[str]) -> list[str]:
    """The words of a command line, if a person could have typed and read them.

    Raises:
        InputError: a word that is empty, no print, or a book, or an option that is given twice or is tyro's own.
    """
    if alone := [word for word in words if word in ("", "--") or EMPTY.fullmatch(word)]:
        raise InputError(f"{alone[0]!r} was given; expected options, each with its values, none of them empty")
    options = [word.partition("=")[0].replace("_", "-") for word in words if word.startswith("--")]
    if any(option.startswith("--tyro-") for option in options):
        raise InputError(f"options of tyro's own were given; for --completion, expected one of {', '.join(SHELLS)}")
    if twice := [one for i, one in enumerate(options) if one in options[:i]]:
        raise InputError(f"{literal(twice[0][:LONGEST])} was given twice; expected every option once")
    for word in words:
        if len(word) > LONGEST or not word.isprintable():
            raise InputError(f"{literal(word)}: expected words of at most {LONGEST} printable characters")
    return words


def shell(words: Sequence[str]) -> str:
    """The shell that stands behind `--completion`.

    Raises:
        InputError: it is not one of those that are known.
    """
    if len(words) != 1 or words[0] not in SHELLS:
        given = f"was given {literal(' '.join(words))!r:.80}" if words else "stands alone"
        raise InputError(f"--completion {given}; expected one of {', '.join(SHELLS)}")
    return words[0]


@contextmanager
def typed(words: Sequence[str]) -> Iterator[None]:
    """While the block runs, a command is at work that was asked for by these words, with files as they are now."""
    before = _TYPED.set(words), _OWN.set({file: digest_of(file) for file in files(words)})
    try:
        yield
    finally:
        _TYPED.reset(before[0])
        _OWN.reset(before[1])


def own() -> dict[Path, str]:
    """The files that the words of the command at work name -> digest, as it began."""
    return dict(_OWN.get())


def command() -> list[str]:
    """The words that decide what comes of the command at work; none where it was not asked for by words."""
    return deciding(_TYPED.get())


def deciding(words: Sequence[str]) -> list[str]:
    """Words without the options on which no number depends, so that these may be given anew."""
    kept, coming = [], iter(words)
    for word in coming:
        option, given, _ = word.partition("=")
        values = INDIFFERENT.get(option.replace("_", "-"))
        if values is None:
            kept.append(word)
        elif not given:
            for _ in range(values):
                next(coming, "")
    return kept


def named(words: Sequence[str]) -> Iterator[str]:
    """Everything that may be a name: words, values behind `=`, and controllers that TOML files among them name; all
    without what tells that a mechanism is left out."""
    from hexmj.controllers.varied_names import PART

    for word in words:
        name = PART.sub("", word.partition("=")[2] if word.startswith("--") else word)
        yield name
        if isfile(name) and not name.endswith(NO_TOML):
            with suppress(InputError):
                yield PART.sub("", str(read_toml(Path(name)).get("controller", "")))


def files(words: Sequence[str]) -> list[Path]:
    """Files that words behind a command name, as they name them: `mine.py` of `mine.py:Tripod`, weights, recordings."""
    wheres = ((name, *name.rpartition(":")[::2]) for name in named(words[1:]))
    paths = (where if what and where.endswith(".py") else name for name, where, what in wheres)
    return [Path(path) for path in dict.fromkeys(paths) if isfile(path) and not _means_no_file(path)]


def _means_no_file(word: str) -> bool:
    """Whether a word is a number or a name that the package knows, whatever lies in the folder."""
    from hexmj.conditions import GroundKind
    from hexmj.controllers.named import known_names
    from hexmj.timing import WINDOWS

    with suppress(ValueError):
        float(word)
        return True
    return word in {*known_names(), *WINDOWS, *get_args(GroundKind)}
