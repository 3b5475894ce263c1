"""The commands: what each does, and their options from the words of a command line."""

from dataclasses import dataclass
from functools import reduce
from importlib import import_module
from operator import or_
from types import SimpleNamespace
from typing import Annotated, Any

import tyro
from tyro.conf import FlagCreatePairsOff, subcommand

from hexmj.version import __version__

ABOUT = (
    "Controllers of six-legged walking drive a stick insect in MuJoCo, and its stability is measured twice.\n\n"
    "hexmj --version tells the version; hexmj --tyro-print-completion bash (zsh) prints what completes words in a shell."
)

GOES_ON = "Repeat the command to go on"
AGAIN = f"\n\n{GOES_ON} with a {{}} that was stopped."

COMMANDS = {
    "compare": "Kinematic, measured and physical FLSS on the same starts: table, figure, NetCDF, manifest and one gait"
    f" video.{AGAIN.format('run')}",
    "flss": "FLSS of one controller over velocities, kinematic or physical."
    f"\n\n{GOES_ON} with a run that was stopped, if it has --out.",
    "walk": "One walk, kinematic or physical: footfall diagram, stability margin and a recording (NetCDF).",
    "render": "A gait video, from recordings or from a walk that is recorded first.",
    "page": "One HTML file that plays a recording, or two side by side: 3D, footfall diagram and stability margin; it"
    " needs no network.",
    "view": "Look at an insect while it walks, or at a recording: in MuJoCo's viewer where there is a screen, else in a"
    " browser.",
    "search": "Parameters that minimise the FLSS: a population with few starts, then the downhill simplex with"
    f" many.{AGAIN.format('search')}",
    "reproduce": "The paper's Section 5: every claim with our number and verdict, Figures 2-6, phase histograms,"
    f" footfall diagrams.{AGAIN.format('run')}",
    "readings": "Which reading of the paper explains its numbers best: every combination of choices, scored by the"
    f" claims.{AGAIN.format('run')}",
    "converge": "The same starts at smaller and smaller V_p: does the insect tend to its plan and to the static"
    f" criterion?{AGAIN.format('run')}",
    "terrain": "Steps, gaps, hurdles and rough ground in physics: how often the insect falls once it has reached"
    f" one.{AGAIN.format('run')}",
    "map": f"Physical FLSS over the velocity and one condition, and why starts fall or do not.{AGAIN.format('run')}",
    "disturb": "Walks that a halt, a stopped leg or a push disturbs, on paper and in physics, and what three strategies"
    f" buy.{AGAIN.format('run')}",
    "biology": "Forces, torques, gait, posture and work of the walking insect beside those of measured"
    f" insects.{AGAIN.format('run')}",
    "league": "Controllers from the literature and your own, judged by the same starts on paper, in physics and in"
    f" trials: tables, figure, film.{AGAIN.format('run')}",
    "ablate": "What each mechanism of the network or rule of Walknet buys: the same starts without it, on paper, in the"
    f" limit and in physics.{AGAIN.format('run')}",
    "rerun": "Makes a result again from its manifest: is every number equal to the last bit?  If not, exit code 1 and"
    " a sentence on what else is not as it was.",
    "check-controller": "Does a controller keep the protocol?  A check that fails says in a sentence what is wrong;"
    " exit code 1 then.",
    "doctor": "Checks of this machine, each with a remedy where it fails; exit code 1 if one does.",
}
"""Name of a command -> what it does.  Its options are a class with a method `run`: `CheckController` of the module
`check_controller`."""


@dataclass(frozen=True)
class _Listed:
    """Stands for the options of a command that is only listed."""


def options_of(words: list[str]) -> Any:
    """The options of the command that is asked for; no other is imported then, and none that are only listed."""
    if words == ["--version"]:
        return SimpleNamespace(run=lambda: print(f"hexmj {__version__}"))
    how: Any = {"config": (FlagCreatePairsOff,)}
    listed = words in (["--help"], ["-h"])
    if not listed:
        from hexmj.cli.registry import registry

        how["registry"] = registry
    if words and words[0] in COMMANDS:
        about = COMMANDS[words[0]]
        return tyro.cli(_class(words[0]), prog=f"hexmj {words[0]}", description=about, args=words[1:], **how)
    commands = [
        Annotated[_Listed if listed else _class(name), subcommand(name, description=about)]
        for name, about in COMMANDS.items()
    ]
    any_command: Any = reduce(or_, commands)
    return tyro.cli(any_command, prog="hexmj", description=ABOUT, args=words, **how)


def _class(command: str) -> Any:
    module = import_module(f"hexmj.cli.{command.replace('-', '_')}")
    return getattr(module, command.title().replace("-", ""))
