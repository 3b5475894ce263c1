"""Small sweeps and searches that note each of their computations, to be broken and gone on with."""

import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import xarray as xr

import hexmj
from hexmj.cli.main import main
from hexmj.measures.compare import compare
from hexmj.measures.kinematic import first_loss
from hexmj.search.forms import FieldsForm
from hexmj.search.problems import Problem
from hexmj.search.stages import Effort, search
from hexmj.io import results_folder, save
from hexmj.sweep import Cell, over_axes, run_cells
from tests.soak import counted
from tests.soak.counted import Counted

RESULT = "result.nc"

SIZES = {"population": 3, "simplex": 2}
"""Starts of the stages of a search, by which their evaluations are told apart."""


def losses(controller: Counted, velocity: float) -> xr.Dataset:
    """A kinematic cell: when each of some starts is lost."""
    return xr.Dataset({"lost": ("start", first_loss(hexmj.draw_starts(5, 0), controller, velocity, 20.0))})


def sweep(folder: Path, n: int = 2, **how: Any) -> None:
    """Kinematic cells and what comes of them."""
    results_folder(folder, [RESULT])
    velocities = [round(0.3 + 0.1 * i, 1) for i in range(n)]
    cells = [Cell(f"V-{v:g}", losses, {"controller": Counted(), "velocity": v}) for v in velocities]
    found = over_axes({"velocity": n}, run_cells(cells, folder / "walks", **how))
    save(found, folder / RESULT)


def physical(folder: Path, **how: Any) -> None:
    """Physical cells, by the API."""
    results_folder(folder, [RESULT])
    found = compare(Counted(), [0.3, 0.5], n_starts=2, window=2.0, folder=folder / "walks", **how)
    save(found, folder / RESULT)


def searched(folder: Path, conditions: hexmj.Conditions | None = None) -> None:
    """A search, kinematic unless conditions are given, and its history."""
    results_folder(folder, [RESULT])
    effort = Effort(
        population=3, budget=6, refine_budget=3, domain=2.0,
        starts=SIZES["population"], refine_starts=SIZES["simplex"],
    )  # fmt: skip
    problem = Problem(FieldsForm(Counted()), 0.5, 0.5, 2.0, conditions=conditions)
    found = search(problem, effort, folder=folder / "evaluations", threads=1)
    save(found.history, folder / RESULT)


def pooled(job: Callable[..., None], folder: Path) -> None:
    """A job on two processes of the user's own."""
    with ProcessPoolExecutor(2, get_context("fork")) as executor:
        job(folder, executor=executor)


def killed(seed: int) -> xr.Dataset:
    """A cell whose process is killed, as the system does where memory is short."""
    if seed:
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGKILL)
    return xr.Dataset({"seed": seed})


def loses_a_process(folder: Path, **how: Any) -> None:
    """A sweep of which one process is killed."""
    run_cells([Cell(f"{seed}", killed, {"seed": seed}) for seed in (0, 1)], folder / "walks", **how)


def command(folder: Path, *more: str) -> None:
    """The command, as from a terminal."""
    words = "compare", "--models", f"{counted.__file__}:Counted", "--velocities", "0.3", "0.5", "--starts", "2"
    sys.argv = ["hexmj", *words, "--window", "2", "--no-video", *more, "--out", str(folder)]
    main()


def on_processes(folder: Path) -> None:
    """The command, whose cells are computed by two processes."""
    command(folder, "--processes", "2")


@dataclass(frozen=True)
class Job:
    """What may be broken."""

    work: Callable[[Path], None]
    flight: int = 1
    """Computations that may be under way at once, and so be lost."""
    like: str = ""
    """A job with the same sources."""


JOBS = {
    "sweep": Job(sweep),
    "sweep on processes": Job(partial(pooled, partial(sweep, n=6)), 3, "sweep"),
    "search": Job(searched, 3),
    "physical": Job(physical),
    "physical on processes": Job(partial(pooled, physical), 2, "physical"),
    "physical search": Job(partial(searched, conditions=hexmj.Conditions())),
    "killed process": Job(partial(pooled, loses_a_process), like="sweep"),
    "command": Job(command),
    "command on processes": Job(on_processes, 2, "command"),
}


def noted(log: Path) -> Counter[str]:
    """How often each computation was begun."""
    return Counter(log.read_text().splitlines()) if log.exists() else Counter()
