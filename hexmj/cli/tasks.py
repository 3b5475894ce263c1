"""`hexmj task` and `hexmj league`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import Answer, StudyCommand
from hexmj.cli.options import Figures, Output, Workers, build
from hexmj.cli.output import show, table
from hexmj.errors import InputError
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class TaskOptions:
    """Options of `hexmj task` that its study does not have."""

    tasks: tuple[str, ...]
    """Tasks: TOML files, or names that `hexmj league --list` shows."""
    controllers: tuple[str, ...] = ("ldvs",)
    """Controllers that walk."""


@dataclass(frozen=True)
class LeagueOptions:
    """Options of `hexmj league` that its study does not have."""

    controllers: tuple[str, ...] | None = None
    """Controllers that take part, by default all of the league."""
    tasks: tuple[str, ...] | None = None
    """Tasks, by default the fourteen of the league."""
    quick: bool = False
    """Run a small league: four controllers and 8 starts. Values that you give for these options take precedence."""
    list: bool = False
    """Print the names of controllers and tasks, and run nothing."""


class Task(StudyCommand):
    """Let controllers walk tasks in physics: on command, over terrain, with pushes, obstacles and lost legs. Repeat the
    command to resume a stopped run."""

    study = "tasks.runner:TaskStudy"
    sources = (TaskOptions, study, Output, Workers)
    positional = "tasks"
    data = "tasks.nc"
    examples = ("slalom --controller ldvs graham --starts 20", "push mine.toml --controller mine.py:Mine")

    def build(self, given: SimpleNamespace) -> Any:
        return _study(given, given.tasks, given.controller)

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.tasks.league import ABOUT, MEANS, task_rows

        for task in study.tasks:
            yield f"{task.name}: {task.about}".rstrip(": ")
            yield table(("controller", "walks", "fell", *MEANS.values(), "refused"), task_rows(result, task.name))
        yield ABOUT


class League(StudyCommand):
    """Compare controllers from the literature and your own in the same tasks, on the same starts. Write tables and
    figures. Repeat the command to resume a stopped run."""

    study = "tasks.runner:TaskStudy"
    sources = (LeagueOptions, study, Output, Workers, Figures)
    data = "league.nc"
    figures = {"league": "matrix", "cost": "cost"}  # noqa: RUF012
    examples = ("--quick --processes 2", "--controller ldvs mine.py:Mine --tasks curve step")

    def run(self, given: SimpleNamespace) -> Answer:
        if given.list:
            from hexmj.tasks.league import EVERYONE, TASKS
            from hexmj.tasks.task import known_tasks, load_task

            show("Controllers: " + ", ".join(EVERYONE), "Tasks of the league: " + ", ".join(TASKS), "All tasks:")
            show(table(("task", "about"), [(name, load_task(name).about) for name in known_tasks()], None))
            raise SystemExit(0)
        return super().run(given)

    def build(self, given: SimpleNamespace) -> Any:
        from hexmj.tasks.league import EVERYONE, FOUR, TASKS
        from hexmj.tasks.runner import TaskStudy

        if given.controller is None:
            given.controller = FOUR if given.quick else EVERYONE
        if given.quick and given.starts == TaskStudy.n_starts:
            given.starts = 8
        return _study(given, TASKS if given.tasks is None else given.tasks, given.controller)

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.tasks.league import matrix_rows

        yield "Frequency of falls, with 95 % intervals; league.md has all other outcomes"
        yield table(("controller", *result.task.values), matrix_rows(result))

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write all tables as Markdown."""
        from hexmj.files import write_text
        from hexmj.tasks.league import league_markdown

        return [write_text(given.out / "league.md", league_markdown(result))]


def _study(given: SimpleNamespace, tasks: Sequence[str], controllers: Sequence[str]) -> Any:
    from hexmj.tasks.league import entrants
    from hexmj.tasks.runner import TaskStudy
    from hexmj.tasks.task import load_task

    if not tasks:
        raise InputError("no task is given; `hexmj league --list` shows the names of tasks")
    distinct("--controller", controllers)
    return build(TaskStudy, given, tasks=[load_task(name) for name in tasks], controllers=entrants(controllers))
