"""The command line: typed options in, one call to the package, tables and files out."""

import os
import sys
from functools import reduce
from importlib import import_module
from operator import or_
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import FlagCreatePairsOff, subcommand

from hexmj.cli.options import registry
from hexmj.errors import InputError, RenderingError, SimulationError
from hexmj.literal import literal
from hexmj.replay.film.gl import drop_vain_wish

ABOUT = "Controllers of six-legged walking drive a stick insect in MuJoCo, and its stability is measured twice."

COMMANDS = {
    "compare": "Compare",
    "flss": "Flss",
    "walk": "Walk",
    "render": "Render",
    "search": "Search",
    "reproduce": "Reproduce",
    "converge": "Converge",
    "terrain": "Terrain",
    "map": "Map",
    "disturb": "Disturb",
    "check-controller": "CheckController",
    "doctor": "Doctor",
}
"""Name of a command -> the class of its options, in a module of the command's name, with a method `run`."""


def main() -> None:
    """The command `hexmj`: exit code 2 for input that makes no sense, 1 for a simulation that failed."""
    drop_vain_wish()
    sys.path.append("")  # for modules of the user's own in the current folder, as `python -m hexmj` finds them
    options: Any = None
    try:
        try:
            options = _options(sys.argv[1:])
            options.run()
        finally:
            if sys.stdout:  # there is none where it was closed
                sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(_complain("stopped", 130))
    except InputError as error:
        sys.exit(_complain(error, 2))
    except SimulationError as error:
        sys.exit(_complain(f"{error}{_kept(error, getattr(options, 'out', None))}", 1))
    except RenderingError as error:
        sys.exit(_complain(error, 1))
    except BrokenPipeError:  # whoever read the output has gone, as `head` does
        _drop_output()
        sys.exit(141)
    except OSError as error:
        _drop_output()
        sys.exit(_complain(f"{error.filename or 'standard output'}: {error.strerror or error}", 2))


def _options(words: list[str]) -> Any:
    """The options of the command that is asked for; no other is imported then."""
    how: Any = {"registry": registry, "config": (FlagCreatePairsOff,)}
    if words and words[0] in COMMANDS:
        return tyro.cli(_class(words[0]), prog=f"hexmj {words[0]}", args=words[1:], **how)
    any_command: Any = reduce(or_, [Annotated[_class(name), subcommand(name)] for name in COMMANDS])
    return tyro.cli(any_command, prog="hexmj", description=ABOUT, args=words, **how)


def _class(command: str) -> Any:
    return getattr(import_module(f"hexmj.cli.{command.replace('-', '_')}"), COMMANDS[command])


def _kept(error: SimulationError, out: Path | None) -> str:
    """Where the last good state of a simulation that failed is kept, as the end of a sentence."""
    if not error.state:
        return ""
    if out is None:
        return "; give --out to keep its last good state there"
    from hexmj.physics.divergence import save_state

    try:
        return f"; its last good state is in {save_state(error, out)}"
    except InputError as problem:
        return f"; its last good state is lost: {problem}"


def _drop_output() -> None:
    """Nothing more is written to standard output, nor tried at the end of the program."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(error: Exception | str, code: int) -> int:
    print(f"hexmj: {literal(str(error))}", file=sys.stderr)
    return code
