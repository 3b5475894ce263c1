"""Base classes of the commands: they parse options, show help, run a study, write its files and print the answer."""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from itertools import count
from pathlib import Path
from textwrap import fill
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

from hexmj.cli.options import Figures, Output, Planning, Results, Workers, build, flat, options_class
from hexmj.cli.output import lists_of, show
from hexmj.errors import RenderingError

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.sweep import Study


MANY = 12
"""Number of files from which on only their folder is printed."""


@dataclass
class Answer:
    """Answer of a command: its JSON object, its tables and lines for the terminal, and the content of its manifest."""

    json: Mapping[str, Any]
    lines: Iterable[Any]
    files: list[Path] = field(default_factory=list)
    """Files that the command wrote."""
    settings: Mapping[str, Any] | None = None
    """Settings that the manifest records; with None, no manifest is written."""
    manifest: str = "manifest.json"
    """File name of the manifest in the folder of --out."""
    result: "xr.Dataset | None" = None
    """Result of a study. The manifest records its settings, and the terminal shows its `settings_line`."""
    closing: Sequence[str] = ()
    """Lines after the names of the files."""


class Command:
    """Base class of the commands. The docstring of each command is its description in `--help`."""

    sources: ClassVar[tuple[type | str, ...]] = ()
    """Dataclasses whose fields become options, or places of dataclasses, such as "measures.compare:Comparison"."""
    hidden: ClassVar[tuple[str, ...]] = ()
    """Fields of `sources` that do not become options."""
    defaults: ClassVar[Mapping[str, Any]] = {}
    """Option -> its default, where this command has another default than the dataclass."""
    positional: ClassVar[str] = ""
    """Option whose value is given without the option's name."""
    examples: ClassVar[tuple[str, str]]
    """Arguments of the two examples that `--help` shows."""

    def options(self, name: str, help: bool = True) -> type:
        """Return the class of options that tyro parses; without `help`, its options have no help texts."""
        return self._options_of(self.sources, self.defaults, name, help)

    def _options_of(self, places: Iterable[type | str], defaults: Mapping[str, Any], name: str, help: bool) -> type:
        sources = [imported(place) if isinstance(place, str) else place for place in places]
        choices: Any = {"positional": self.positional, "hidden": self.hidden, "defaults": defaults}
        return options_class(name.replace("-", "_"), *sources, help=help, **choices)

    def parse(self, name: str, words: list[str]) -> SimpleNamespace:
        """Parse the words after the command's name, and return the values of all options by name."""
        import tyro

        help = not {"-h", "--help"}.isdisjoint(words)
        markers: Any = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
        if help:
            print(fill(" ".join((self.__doc__ or "").split()), 80), end="\n\n")
        try:
            parser: Any = {"prog": f"hexmj {name}", "description": "", "config": markers}
            parsed = tyro.cli(self.options(name, help), args=words, **parser)
        except SystemExit:
            if help:
                print("Examples:", *(f"  hexmj {name} {example}".rstrip() for example in self.examples), sep="\n")
            raise
        return SimpleNamespace(**vars(flat(parsed)), command=[name, *words])

    def run(self, given: SimpleNamespace) -> Answer | None:
        """Run the command with its parsed options. Return the answer, or None if the command has printed it itself."""
        raise NotImplementedError

    def execute(self, given: SimpleNamespace) -> None:
        """Run the command, write the manifest, and print the answer."""
        from hexmj.io import json_text, save_manifest, settings

        if (answer := self.run(given)) is None:
            return
        files, result = answer.files, answer.result
        recorded = answer.settings if result is None else settings(result)
        if recorded is not None and given.out:
            files.append(save_manifest(given.command, recorded, files, given.out / answer.manifest))
        if given.json:
            head = {} if result is None else {"settings": recorded, "searched": searched(given)}
            print(json_text(head | dict(answer.json) | {"files": files}))
        else:
            line = [] if result is None else [settings_line(given, result)]
            paths = map(str, files) if len(files) < MANY else [f"{len(files)} files in {given.out}"]
            show(*answer.lines, *line, *paths, *answer.closing)


class StudyCommand(Command):
    """A command that runs a study, writes its result and figures, and prints tables."""

    study: ClassVar[str]
    """Place of the study's dataclass, such as "studies.biology:Biology"."""
    data: ClassVar[str]
    """Name of the NetCDF file; an option in braces, as in "{over}.nc", is replaced by its value."""
    figures: ClassVar[Mapping[str, str]]
    """File name of a figure without its suffix -> name of the figure for `hexmj.plot`."""
    manifest: ClassVar[str] = "manifest.json"
    own: ClassVar[tuple[type, ...]] = ()
    """Dataclasses whose fields become options of this command in addition to the study's options."""
    planning: ClassVar[tuple[type, ...]] = (Planning,)
    """Dataclasses of options for planning; () for a command without these options."""

    def options(self, name: str, help: bool = True) -> type:
        sources = (*self.own, self.study, Results, Output, *self.planning, Workers, Figures)
        return self._options_of(sources, {"out": Path("results") / name, **self.defaults}, name, help)

    def build(self, given: SimpleNamespace) -> "Study":
        """Build the study from the options."""
        return build(imported(self.study), given)

    def result(self, given: SimpleNamespace, study: Any) -> "xr.Dataset":
        """Run the study and return its result."""
        from hexmj.sweep import run_study

        with at_work(given, given.command[0]) as execution:
            return run_study(study, given.out and given.out / "walks", **execution)

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Return the JSON answer: by default all variables of the result that have no value for each start."""
        return lists_of(result.drop_dims("start", errors="ignore"))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        """Return the tables and lines that the terminal shows."""
        raise NotImplementedError

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write the files of this command beside data and figures, such as a film, and return their paths."""
        return []

    def run(self, given: SimpleNamespace) -> Answer:
        """Run the study, write its files unless --out is None, and return the answer."""
        from hexmj.io import results_folder, save

        study, folder = self.build(given), given.out and results_folder(given.out)
        result, files = self.result(given, study), list[Path]()
        if folder:
            files.append(save(result, folder / self.data.format(**vars(given))))
            for name, which in self.figures.items():
                files.append(draw(result, folder / f"{name.format(**vars(given))}.{given.format}", which))
            files += self.write_more(given, result)
        manifest = self.manifest.format(**vars(given))
        closing = [] if folder else ["Nothing is saved; --out FOLDER saves the table, a figure and a manifest."]
        own = {"manifest": manifest, "result": result, "closing": closing}
        return Answer(self.summary(result), self.shown(study, result), files, **own)


def imported(place: str) -> Any:
    """Import an object by its place in hexmj, such as "measures.compare:Comparison"."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"hexmj.{module}"), name)


@contextmanager
def at_work(given: SimpleNamespace, label: str) -> Iterator[dict[str, Any]]:
    """Start the workers that the options ask for and a progress bar; provide the values of `hexmj.sweep.Execution`."""
    from hexmj.progress import progress_bar
    from hexmj.sweep import threads_each, workers

    with workers(given.processes, given.scheduler) as executor, progress_bar(label) as progress:
        threads = threads_each(given.threads, given.processes)
        yield {"executor": executor, "progress": progress, "threads": threads, "fresh": given.fresh}


def draw(result: "xr.Dataset", path: Path, which: str | None = None) -> Path:
    """Draw a figure of a result and save it at `path`; `which` is a name for `hexmj.plot`."""
    from hexmj.io import save_figure
    from hexmj.plotting import as_shipped, plot

    with as_shipped():
        return save_figure(plot(result, which), path)


def filmed(path: Path, recordings: "Sequence[xr.Dataset]", *film: Any) -> list[Path]:
    """Film recordings and return [path]; if this machine cannot render films, print the reason and return []."""
    from hexmj.replay.video import render

    try:
        render(recordings, path, *film, progress=True)
    except RenderingError as error:
        print(f"hexmj: no video: {error}", file=sys.stderr)
        return []
    return [path]


def searched(given: SimpleNamespace) -> dict[str, list[int]]:
    """Return each controller that a search found on the starts of --seed -> all seeds of its search."""
    from hexmj.controllers.registry import searched_on

    names: Iterable[str] = [given.controller] if isinstance(given.controller, str) else given.controller
    found = {base: seeds for name in names for base, seeds in searched_on(name).items()}
    return {base: seeds for base, seeds in found.items() if given.seed in seeds}


def settings_line(given: SimpleNamespace, result: "xr.Dataset") -> str:
    """Return the settings of a result as one line, with a warning if a controller was searched on the same starts."""
    from hexmj.measures.figures import caption

    line = caption(result).replace("$", "").replace("\N{NO-BREAK SPACE}", " ")
    if found := searched(given):
        seed = next(seed for seed in count(1998) if not any(seed in seeds for seeds in found.values()))
        line += f"; {', '.join(found)}: found by a search on these starts, use fresh starts (--seed {seed})"
    return line
