"""Base of the commands: options, help with examples, running a study, and the answer with its manifest."""

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
from hexmj.cli.output import lists_of, print_json, show
from hexmj.errors import RenderingError

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.sweep import Study


@dataclass
class Answer:
    """What a command prints: a JSON object, or tables and lines; and what its manifest records."""

    json: Mapping[str, Any]
    lines: Iterable[Any]
    files: list[Path] = field(default_factory=list)
    """Files that the command wrote."""
    settings: Mapping[str, Any] | None = None
    """Settings for the manifest; None writes no manifest."""
    manifest: str = "manifest.json"
    """Name of the manifest in the folder of --out."""
    result: "xr.Dataset | None" = None
    """Result whose settings are recorded and stand under the lines, with a warning if starts were searched on."""


class Command:
    """A command; its docstring is the description in `--help`."""

    sources: ClassVar[tuple[type | str, ...]] = ()
    """Dataclasses of settings that options are made from, or their places, such as "measures.compare:Comparison"."""
    hidden: ClassVar[tuple[str, ...]] = ()
    """Fields of them that are not offered."""
    usual: ClassVar[Mapping[str, Any]] = {}
    """Options with other defaults than those of the dataclasses."""
    positional: ClassVar[str] = ""
    """Option that is given without its name."""
    examples: ClassVar[tuple[str, str]]
    """Arguments of two examples for `--help`."""

    def options(self, name: str, help: bool = True) -> type:
        """Return the class of options that tyro parses."""
        sources = [imported(source) if isinstance(source, str) else source for source in self.sources]
        how: Any = {"positional": self.positional, "hidden": self.hidden, "usual": self.usual}
        return options_class(name.replace("-", "_"), *sources, help=help, **how)

    def parse(self, name: str, words: list[str]) -> SimpleNamespace:
        """Return the options by name that the words after the command's name give."""
        import tyro

        help = not {"-h", "--help"}.isdisjoint(words)
        markers: Any = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
        if help:
            print(fill(" ".join((self.__doc__ or "").split()), 80), end="\n\n")
        try:
            how: Any = {"prog": f"hexmj {name}", "description": "", "config": markers}
            parsed = tyro.cli(self.options(name, help), args=words, **how)
        except SystemExit:
            if help:
                print("Examples:", *(f"  hexmj {name} {example}".rstrip() for example in self.examples), sep="\n")
            raise
        return SimpleNamespace(**vars(flat(parsed)), command=[name, *words])

    def run(self, given: SimpleNamespace) -> Answer | None:
        """Run the command with its options by name, and return the answer unless it has been printed."""
        raise NotImplementedError

    def execute(self, given: SimpleNamespace) -> None:
        """Run the command, write the manifest, and print the answer."""
        from hexmj.io import save_manifest, settings

        if (answer := self.run(given)) is None:
            return
        files, result = answer.files, answer.result
        made = answer.settings if result is None else settings(result)
        if made is not None and given.out:
            files.append(save_manifest(given.command, made, files, given.out / answer.manifest))
        if given.json:
            more = {} if result is None else {"settings": made, "searched": searched(given)}
            print_json(more | dict(answer.json) | {"files": files})
        else:
            show(*answer.lines, *([] if result is None else [settings_line(given, result)]), *map(str, files))


class StudyCommand(Command):
    """A command that runs a study, writes its result and figures, and prints tables."""

    study: ClassVar[str]
    """Place of the study's dataclass."""
    data: ClassVar[str]
    """Name of the NetCDF file, in which options may stand in braces."""
    figures: ClassVar[Mapping[str, str]]
    """File of a figure, without its ending -> name of the figure, see `hexmj.plot`."""
    manifest: ClassVar[str] = "manifest.json"
    own: ClassVar[tuple[type, ...]] = ()
    """Dataclasses of options beside those of the study."""
    planning: ClassVar[tuple[type, ...]] = (Planning,)

    def options(self, name: str, help: bool = True) -> type:
        self.sources = (*self.own, self.study, Results, Output, *self.planning, Workers, Figures)  # pyright: ignore
        self.usual = {"out": Path("results") / name, **self.usual}  # pyright: ignore
        return super().options(name, help)

    def build(self, given: SimpleNamespace) -> "Study":
        """Return the study that the options describe."""
        return build(imported(self.study), given)

    def result(self, given: SimpleNamespace, study: Any) -> "xr.Dataset":
        """Run the study."""
        from hexmj.sweep import run_study

        with at_work(given, given.command[0]) as execution:
            return run_study(study, given.out and given.out / "walks", **execution)

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Return the JSON answer: by default everything but single starts."""
        return lists_of(result.drop_dims("start", errors="ignore"))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        """Return the tables and lines of the answer."""
        raise NotImplementedError

    def others(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write other files, and return their paths."""
        return []

    def run(self, given: SimpleNamespace) -> Answer:
        """Run the study, and write the files if there is a folder for results."""
        from hexmj.io import results_folder, save

        study, folder = self.build(given), given.out and results_folder(given.out)
        result, files = self.result(given, study), list[Path]()
        if folder:
            files.append(save(result, folder / self.data.format(**vars(given))))
            for name, which in self.figures.items():
                files.append(draw(result, folder / f"{name.format(**vars(given))}.{given.format}", which))
            files += self.others(given, result)
        manifest = self.manifest.format(**vars(given))
        return Answer(self.summary(result), self.shown(study, result), files, manifest=manifest, result=result)


def imported(place: str) -> Any:
    """Return an object by its place in hexmj, such as "measures.compare:Comparison"."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"hexmj.{module}"), name)


@contextmanager
def at_work(given: SimpleNamespace, label: str) -> Iterator[dict[str, Any]]:
    """Provide the arguments of `Execution` that the options ask for, with a progress bar."""
    from hexmj.progress import progress_bar
    from hexmj.sweep import threads_each, workers

    with workers(given.processes, given.scheduler) as executor, progress_bar(label) as progress:
        threads = threads_each(given.threads, given.processes)
        yield {"executor": executor, "progress": progress, "threads": threads, "fresh": given.fresh}


def draw(result: "xr.Dataset", path: Path, which: str | None = None) -> Path:
    """Draw a result's figure into a file."""
    from hexmj.io import save_figure
    from hexmj.plotting import as_shipped, plot

    with as_shipped():
        return save_figure(plot(result, which), path)


def filmed(path: Path, recordings: "Sequence[xr.Dataset]", *film: Any) -> list[Path]:
    """Film recordings and return the file, or nothing if films cannot be rendered on this machine."""
    from hexmj.replay.video import render

    try:
        render(recordings, path, *film, progress=True)
    except RenderingError as error:
        print(f"hexmj: no video: {error}", file=sys.stderr)
        return []
    return [path]


def searched(given: SimpleNamespace) -> dict[str, list[int]]:
    """Return the controllers that a search found on the starts of --seed, with the seeds of their searches."""
    from hexmj.controllers.registry import searched_on

    names: Iterable[str] = [given.controller] if isinstance(given.controller, str) else given.controller
    found = {what: seeds for name in names for what, seeds in searched_on(name).items()}
    return {what: seeds for what, seeds in found.items() if given.seed in seeds}


def settings_line(given: SimpleNamespace, result: "xr.Dataset") -> str:
    """Return what stands under every answer: the caption of the result, and a warning if starts were searched on."""
    from hexmj.measures.figures import caption

    line = caption(result).replace("$", "").replace("\N{NO-BREAK SPACE}", " ")
    if found := searched(given):
        seed = next(seed for seed in count(1998) if not any(seed in seeds for seeds in found.values()))
        line += f"; a search used these starts to find {', '.join(found)}, so take others: --seed {seed}"
    return line
