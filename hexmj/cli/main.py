"""The command line: the list of commands, errors as one line, and exit codes."""

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING

from hexmj.errors import InputError, RenderingError, SimulationError
from hexmj.rendering import use_egl_without_display
from hexmj.version import __version__

if TYPE_CHECKING:
    from hexmj.cli.command import Command

HELP = """usage: hexmj COMMAND [OPTIONS]

Controllers of six-legged walking drive a stick insect in MuJoCo; hexmj measures
its stability.

Walk and measure
  walk              one walk: footfall diagram, stability margin and a recording
  flss              frequency of the loss of static stability over velocities
  compare           all measures of stability on the same starts

Look
  render            a video of recordings, or of a walk that is recorded first
  page              an HTML file that plays recordings without a network
  export            joint angles, torques, forces and tips of recordings as CSV
  view              a walk or a recording in a window or a browser

Tasks
  task              walks on command, over terrain, with pushes and lost legs
  league            all controllers in fourteen tasks: tables and figures

Controllers
  search            parameters that minimise the FLSS
  check-controller  interface checks of a controller

Literature
  reproduce         the claims and figures of the 1998 paper
  biology           forces, gait, posture and work compared with insects

Machine
  doctor            checks of this machine, each with a remedy
  rerun             repeat a command from its manifest and compare the results

`hexmj COMMAND --help` shows the options and examples of a command.
`hexmj --version` shows the version; `hexmj --tyro-print-completion bash`
(or zsh) prints a script that completes commands and options."""

MODULES = {
    "measures": ("walk", "flss", "compare"),
    "pictures": ("render", "page", "export", "view"),
    "tasks": ("task", "league"),
    "controllers": ("search", "check-controller"),
    "paper": ("reproduce", "biology"),
    "machine": ("doctor", "rerun"),
}
"""Module of `hexmj.cli` -> its commands. The class of `check-controller` is `CheckController`."""

COMMANDS = {name: module for module, names in MODULES.items() for name in names}


def main() -> None:
    """Run `hexmj`: exit code 2 for bad input, 1 for a failed simulation or rendering, 130 for Ctrl-C."""
    sys.path.append("")  # finds the user's modules in the current directory, as `python -m hexmj` does
    use_egl_without_display()
    try:
        run(sys.argv[1:])
    except (KeyboardInterrupt, SystemError) as error:
        if isinstance(error, SystemError) and not isinstance(error.__cause__, KeyboardInterrupt):
            raise  # Ctrl-C within compiled code is a SystemError
        _exit("Stopped. A repeated study resumes after its finished cells.", 130)
    except (SimulationError, RenderingError) as error:
        _exit(error, 1)
    except BrokenPipeError:  # the reader of standard output has ended, such as `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (InputError, OSError) as error:  # an OSError names the file
        _exit(error, 2)


def run(words: list[str]) -> None:
    """Run the command that `words`, the command line after `hexmj`, asks for."""
    match words:
        case [] | ["-h" | "--help"]:
            print(HELP)
        case ["--version"]:
            print(f"hexmj {__version__}")
        case [word, *_] if word.startswith("--tyro-"):
            _complete(words)
        case [name, *rest] if name in COMMANDS:
            chosen = command(name)
            chosen.execute(chosen.parse(name, rest))
        case [name, *_]:
            raise InputError(f"unknown command {name!r}; `hexmj --help` lists the commands")


def command(name: str) -> "Command":
    """Return a command by its name."""
    return getattr(import_module(f"hexmj.cli.{COMMANDS[name]}"), name.title().replace("-", ""))()


def _complete(words: list[str]) -> None:
    """Print or write the script with which a shell completes commands and options."""
    from tyro.extras import subcommand_cli_from_dict

    subcommand_cli_from_dict({name: command(name).options(name) for name in COMMANDS}, prog="hexmj", args=words)


def _exit(message: Exception | str, code: int) -> None:
    print(f"hexmj: {message}", file=sys.stderr)
    sys.exit(code)
