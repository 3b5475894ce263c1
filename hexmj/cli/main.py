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
        options = _options(sys.argv[1:])
        options.run()
    except KeyboardInterrupt:
        sys.exit(_complain("stopped", 130))
    except InputError as error:
        sys.exit(_complain(error, 2))
    except SimulationError as error:
        sys.exit(_complain(f"{error}{_kept(error, getattr(options, 'out', None))}", 1))
    except RenderingError as error:
        sys.exit(_complain(error, 1))
    except BrokenPipeError:  # whoever read the output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)


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
        path = save_state(error, out)
        return f"; its last good state is in {path}; python -m hexmj.physics.divergence {path} replays it"
    except OSError as problem:
        return f"; its last good state cannot be written to {out}: {problem.strerror or problem}"


def _complain(error: Exception | str, code: int) -> int:
    print(f"hexmj: {error}", file=sys.stderr)
    return code
