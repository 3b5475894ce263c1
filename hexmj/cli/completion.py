"""What tyro has shells complete, with what it leaves out: what commands do, and the words of options that are texts."""

import re
from collections.abc import Mapping
from typing import get_args

PIPED = ('$python_cmd -c "$pycode"', 'printf "%s\\n" "$pycode" | $python_cmd -')
"""How fish asks Python for words, and how it has to: an argument may not be as long as what our options say."""


def completed(script: str, commands: Mapping[str, str]) -> str:
    """The script for a shell, with what the commands do."""
    lines = script.replace(*PIPED).splitlines()
    return "\n".join(_told(line, commands) if line.startswith("COMPLETION_SPEC") else line for line in lines)


def _told(options: str, commands: Mapping[str, str]) -> str:
    """The line of all options and commands."""
    for name, about in commands.items():
        does = re.split(r"(?<=[.?])\s", about)[0].replace("'", "\N{RIGHT SINGLE QUOTATION MARK}")  # no shell's quote
        options = options.replace(f"'{name}': {{'description': '{name}'", f"'{name}': {{'description': '{does}'")
    for name, words in _words().items():  # tyro takes all texts for names of files
        kind = rf"(\['--{name}'\], 'description': (?:(?!'type').)*'type': )'path'"
        options = re.sub(kind, rf"\1'choice', 'choices': {list(words)}", options)
    return re.sub(r"\\+n", " ", options)  # a shell would take a description's second line for a word


def _words() -> dict[str, tuple[str, ...]]:
    """Option that names no file -> the words that it may be, as far as they are known."""
    from hexmj.body import STICK_INSECT
    from hexmj.controllers.cruse1998 import READINGS, Order
    from hexmj.timing import WINDOWS

    named = {"window": WINDOWS, "camera": STICK_INSECT.cameras, "order": get_args(Order), "reading": tuple(READINGS)}
    return named | {"host": (), "scheduler": ()}
