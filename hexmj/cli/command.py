"""Base classes of the commands: they parse options, show help, run a study, write its files and print the answer."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from itertools import chain
from pathlib import Path
from textwrap import fill
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

from hexmj.cli.options import Figures, Output, Planning, Workers, build, option_fields, options_class, values_of
from hexmj.cli.output import show

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.sweep import Study

STUDY = (Output, Planning, Workers, Figures)
"""Options of most studies."""


@dataclass
class Answer:
    """Answer of a command: its JSON object, its tables and lines for the terminal, and the files that it wrote."""

    json: Mapping[str, Any]
    lines: Iterable[Any]
    files: list[Path] = field(default_factory=list)
    settings: Mapping[str, Any] | None = None
    """Settings that the manifest in the folder of --out records; with None, no manifest is written."""


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

    def options(self, name: str) -> type:
        """Return the class of options that tyro parses."""
        title, defaults = name.replace("-", "_"), {"out": Path("results") / name, **self.defaults}
        sources = [imported(place) if isinstance(place, str) else place for place in self.sources]
        options = (option_fields(source, title, self.hidden, defaults) for source in sources)
        return options_class(chain.from_iterable(options), title, self.positional)

    def parse(self, name: str, words: list[str]) -> SimpleNamespace:
        """Parse the words after the command's name, and return the values of all options by name."""
        import tyro

        help = not {"-h", "--help"}.isdisjoint(words)
        markers: Any = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
        if help:
            print(fill(" ".join((self.__doc__ or "").split()), 80), end="\n\n")
        try:
            parsed = tyro.cli(self.options(name), prog=f"hexmj {name}", description="", args=words, config=markers)
        except SystemExit:
            if help:
                print("Examples:", *(f"  hexmj {name} {example}".rstrip() for example in self.examples), sep="\n")
            raise
        return SimpleNamespace(**values_of(parsed), command=[name, *words])

    def run(self, given: SimpleNamespace) -> Answer | None:
        """Run the command with its parsed options. Return the answer, or None if the command has printed it itself."""
        raise NotImplementedError

    def execute(self, given: SimpleNamespace) -> None:
        """Run the command, write the manifest, and print the answer."""
        from hexmj.io import MANIFEST, json_text, save_manifest

        if (answer := self.run(given)) is None:
            return
        files = answer.files
        if answer.settings is not None and given.out:
            files.append(save_manifest(given.command, answer.settings, files, given.out / MANIFEST))
        if given.json:
            print(json_text({**answer.json, "files": files}))
        else:
            show(*answer.lines, *([f"{given.out}: {', '.join(file.name for file in files)}"] if files else []))


class StudyCommand(Command):
    """A command that runs a study, writes its result and figures, and prints tables."""

    study: ClassVar[str]
    """Place of the study's dataclass, such as "studies.biology:Biology"."""
    data: ClassVar[str]
    """Name of the NetCDF file."""
    figures: ClassVar[Mapping[str, str]] = {}
    """File name of a figure without its suffix -> name of the figure for `hexmj.plot`."""

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
        shown = result.drop_dims("start", errors="ignore")
        return {str(name): shown[name].values.tolist() for name in shown.variables}

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        """Return the tables and lines that the terminal shows."""
        raise NotImplementedError

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write the files of this command beside data and figures, such as tables, and return their paths."""
        return []

    def run(self, given: SimpleNamespace) -> Answer:
        """Run the study, write its files unless --out is None, and return the answer."""
        from hexmj.io import save, settings

        study = self.build(given)
        if given.out:
            given.out.mkdir(parents=True, exist_ok=True)
        result, files = self.result(given, study), list[Path]()
        if given.out:
            files.append(save(result, given.out / self.data))
            files += [draw(result, given.out / f"{name}.{given.format}", which) for name, which in self.figures.items()]
            files += self.write_more(given, result)
        recorded, searched = settings(result), searched_on_seed(given)
        answer = {"settings": recorded, "searched": searched} | self.summary(result)
        return Answer(answer, [*self.shown(study, result), settings_line(result, searched)], files, recorded)


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


def searched_on_seed(given: SimpleNamespace) -> dict[str, list[int]]:
    """Return each controller that a search found on the starts of --seed -> all seeds of its search."""
    from hexmj.controllers.registry import searched_on

    names: Iterable[str] = [given.controller] if isinstance(given.controller, str) else given.controller
    found = {base: seeds for name in names for base, seeds in searched_on(name).items()}
    return {base: seeds for base, seeds in found.items() if given.seed in seeds}


def settings_line(result: "xr.Dataset", searched: Mapping[str, list[int]]) -> str:
    """Return the settings of a result as one line, with a warning if a controller was searched on the same starts."""
    from hexmj.measures.figures import caption

    warning = f"; {', '.join(searched)}: found by a search on these starts, use another --seed" if searched else ""
    return caption(result).replace("$", "").replace("\N{NO-BREAK SPACE}", " ") + warning
