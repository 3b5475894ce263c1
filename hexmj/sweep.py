"""Sweeps: many cells, each a pure function of its settings, computed on any executor and cached in a folder.

The cache key of a cell is a digest of its function and settings, of hexmj's sources and of the versions of the packages
that compute. If the settings hold classes of the user, it also covers their source files and the `.py` files beside
them. It covers other files that a controller reads only if a field of the controller's dataclass names them.
"""

import json
import math
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from inspect import getsource, signature
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypedDict, Unpack

from hexmj.errors import InputError, without_extra
from hexmj.files import read_netcdf, write_netcdf
from hexmj.plain import digest, plain
from hexmj.progress import Progress, part_of, shown
from hexmj.threads import cores
from hexmj.validate import whole

if TYPE_CHECKING:
    import xarray as xr

PACKAGE = Path(__file__).parent
LIBRARIES = ("mujoco", "numpy", "scipy", "numba")
"""Packages whose versions are part of the cache key."""


@dataclass(frozen=True)
class Cell:
    """One cell of a sweep. Its result depends only on the function and the settings."""

    name: str
    """Readable beginning of the name of the cell's file."""
    function: Callable[..., Any]
    """Function of a module, or method of a frozen dataclass, that returns an `xarray.Dataset`. The sweep passes
    `threads` and `progress` if the function has these arguments."""
    settings: Mapping[str, Any]
    """Arguments of the function: numbers, texts, paths, arrays, frozen dataclasses, or lists and dicts of these."""
    work: float = 1.0
    """Relative computing time of the cell, for the progress bar."""

    def compute(self, **execution: Any) -> Any:
        """Call the function with its settings, and with the arguments of `execution` that it has."""
        accepted = signature(self.function).parameters
        return self.function(**self.settings, **{k: v for k, v in execution.items() if k in accepted})

    def record(self) -> str:
        """Return the content of the cache key as JSON: the function, its settings, the sources and the versions.

        Raises:
            InputError: a setting cannot be written as JSON.
        """
        definitions: list[Any] = []
        record = {
            "function": plain(self.function, definitions.append),
            "of": plain(getattr(self.function, "__self__", None), definitions.append),
            "settings": plain(self.settings, definitions.append),
        }
        record["sources"] = _user_sources(definitions) | {"hexmj": _package_digest()}
        record["versions"] = {name: version(name) for name in LIBRARIES}
        return json.dumps(record, sort_keys=True)

    def stem(self, record: str) -> str:
        """Return the name of the cell's file without suffix: its name and its cache key, a digest of `record`."""
        readable = re.sub(r"[^A-Za-z0-9.+-]+", "-", self.name)[:100].lstrip(".-")
        return f"{readable}-{digest(record.encode())}"


class Study(Protocol):
    """A frozen dataclass of settings that defines cells and combines their results."""

    def cells(self) -> Sequence[Cell]:
        """Return the cells that must be computed for the result."""
        ...

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Combine the results of the cells, which `data` holds in the order of `cells`."""
        ...


class Execution(TypedDict, total=False):
    """How cells are computed; results do not depend on it."""

    executor: Executor | None
    """Executor that computes the cells in threads, in processes or on other machines that share the folder; by default,
    this process computes the cells one after another."""
    progress: Progress | bool | None
    """True shows a progress bar; a function is called with the fraction of the new work done since its last call. With
    an executor, progress advances when a cell is finished."""
    threads: int | None
    """Number of threads of each cell; by default one per core, or one if there is an executor."""
    fresh: bool
    """True computes all cells again and replaces their cached results."""


class Round(NamedTuple):
    """Cells that a study needs next."""

    cells: Sequence[Cell]
    left: float = 0.0
    """Estimated work of all later rounds, in the unit of `Cell.work`."""


def run_study(study: Study, folder: Path | str | None = None, **execution: Unpack[Execution]) -> "xr.Dataset":
    """Run a study and return its result; arguments and errors are those of `run_cells`.

    A study may have a method `next_round(data)`, which returns the `Round` that follows after cells with these results;
    the study ends at a round without cells. Other studies have one round of `cells`.
    """
    follow = getattr(study, "next_round", lambda data: Round([] if data else study.cells()))
    data, rest = list["xr.Dataset"](), 1.0
    with shown(execution.get("progress"), "computing") as progress:
        while (now := follow(data)).cells:
            work = sum(cell.work for cell in now.cells)
            part = rest * work / (work + now.left)
            data += run_cells(now.cells, folder, **execution | {"progress": part_of(progress, part)})
            rest -= part
        if progress and rest:
            progress(rest)
    return study.result(data)


def run_cells(
    cells: Sequence[Cell], folder: Path | str | None = None, **execution: Unpack[Execution]
) -> list["xr.Dataset"]:
    """Compute cells and return their results in order.

    Args:
        cells: cells to compute.
        folder: cache with one file per cell; a cell with a file is read, not computed. None caches nothing.
        execution: see `Execution`.

    Raises:
        InputError: a setting cannot be part of a cache key, or a worker process died. An error of a cell is raised with
            a note that names the cell.
    """
    if unknown := execution.keys() - Execution.__annotations__:
        raise TypeError(f"unexpected keyword arguments: {', '.join(sorted(unknown))}")
    executor, threads = execution.get("executor"), execution.get("threads")
    paths: list[Path | None] = [None] * len(cells)
    if folder is not None:
        Path(folder).mkdir(parents=True, exist_ok=True)
        paths = [Path(folder).absolute() / f"{cell.stem(cell.record())}.nc" for cell in cells]
    if execution.get("fresh"):
        for path in filter(None, paths):
            path.unlink(missing_ok=True)

    found = {i: _cached(path) for i, path in enumerate(paths) if path and path.exists()}
    left = [i for i in range(len(cells)) if i not in found]
    total = sum(cells[i].work for i in left)
    with shown(execution.get("progress"), "computing") as progress:
        if executor is None:
            for i in left:
                advance = _Share(part_of(progress, cells[i].work / total))
                found[i] = _computed(cells[i], paths[i], threads=threads, progress=advance)
                advance(1.0)
        else:
            for i, data in _on_executor(executor, {i: (cells[i], paths[i]) for i in left}, threads or 1):
                found[i] = data
                if progress:
                    progress(cells[i].work / total)
        if progress and not left:
            progress(1.0)
    return [found[i] for i in range(len(cells))]


class _Share:
    """Progress function of a cell, which a cell may call or not; in all, it passes on a fraction of 1 at most."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._left = progress, 1.0

    def __call__(self, fraction: float) -> None:
        fraction = min(fraction, self._left)
        self._left -= fraction
        if fraction and self._progress:
            self._progress(fraction)


def _computed(cell: Cell, path: Path | None, **execution: Any) -> "xr.Dataset":
    """Return a cell's result: read its file if that exists, else compute the cell and write the file."""
    if path and path.exists():
        return _cached(path)
    try:
        data = cell.compute(**execution)
    except Exception as error:
        error.add_note(f"while computing the cell {cell.name}")
        raise
    if path is None:
        return data
    return _cached(write_netcdf(data.assign_attrs(cell=cell.record()), path))


def _cached(path: Path) -> "xr.Dataset":
    """Read a cell's result from its file, without the attribute `cell`, which holds the cache key."""
    data = read_netcdf(path)
    data.attrs.pop("cell", None)
    return data


def _on_executor(
    executor: Executor, cells: Mapping[int, tuple[Cell, Path | None]], threads: int
) -> Iterator[tuple[int, "xr.Dataset"]]:
    """Compute cells, each with the path of its file, and yield each with its key as soon as it is finished."""
    futures = {executor.submit(_computed, *cell, threads=threads): i for i, cell in cells.items()}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenExecutor:
        raise InputError(
            "A worker process died. Finished cells are cached. Run again, with fewer processes if memory ran out."
        ) from None
    finally:
        for future in futures:
            future.cancel()


def over_axes(sizes: Mapping[str, int], data: Sequence["xr.Dataset"], **concat: Any) -> "xr.Dataset":
    """Combine the results of cells along named axes into one dataset.

    Args:
        sizes: number of cells along each axis; the last axis varies fastest, as in `itertools.product`.
        data: results of all cells, in this order.
        concat: keyword arguments of `xarray.concat`.
    """
    import xarray as xr

    if (count := math.prod(sizes.values())) != len(data):
        raise InputError(f"{len(data)} cells for axes of the sizes {dict(sizes)}; expected {count}")
    rows = list(data)
    for name, size in reversed(list(sizes.items())):
        rows = [xr.concat(rows[i : i + size], name, **concat) for i in range(0, len(rows), size)]
    return rows[0]


@contextmanager
def workers(processes: int = 1, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Provide an executor: processes of this machine, the workers of a Dask scheduler, or None for this process.

    Args:
        processes: number of processes.
        scheduler: address such as "tcp://127.0.0.1:8786"; the workers must share the folder of the results.
    """
    if scheduler is not None:
        try:
            from distributed import Client
        except ModuleNotFoundError:
            raise without_extra("dask", "distributed") from None
        try:
            client = Client(scheduler, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"scheduler = {scheduler!r} cannot be reached: {error}") from None
        with client:
            yield client.get_executor(pure=False)
    elif whole("processes", processes, 1) > 1:
        with ProcessPoolExecutor(processes, get_context("spawn"), initializer=_end_with_parent) as pool:
            yield pool
    else:
        yield None


def threads_each(threads: int | None, processes: int) -> int | None:
    """Return the threads of each process: `threads`, or by default an equal share of the cores (None for all cores)."""
    return threads if threads is not None or processes == 1 else max(1, cores() // processes)


def _end_with_parent() -> None:
    """Initialise a worker process of a pool so that it exits when its parent process ends, also after a kill."""
    sys.stdout = sys.stderr  # the user's code must not print into the command's answer

    def watch() -> None:
        if parent := parent_process():
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _user_sources(definitions: Iterable[Any]) -> dict[str, str]:
    """Return module of the user's classes and functions -> digest of its file and the `.py` files in its folder."""
    found = {}
    for definition in definitions:
        name = definition.__module__
        if name.partition(".")[0] in sys.stdlib_module_names | {"hexmj", "numpy"} - {"__main__"}:
            continue
        if "<locals>" in definition.__qualname__ or "<lambda>" in definition.__qualname__:
            raise InputError(f"{definition.__qualname__} cannot be cached; define it at the top level of a module")
        file = getattr(sys.modules.get(name), "__file__", None)
        beside = {Path(file), *Path(file).parent.glob("*.py")} if file else None
        found[name] = _files_digest(beside) if beside else digest(getsource(definition).encode())
    return found


@cache
def _package_digest() -> str:
    assets = (PACKAGE / "assets", PACKAGE.parent / "assets")
    return _files_digest([*PACKAGE.rglob("*.py"), *(file for folder in assets for file in folder.glob("*.xml"))])


def _files_digest(files: Iterable[Path]) -> str:
    return digest(b"".join(f"{file.name}\0".encode() + file.read_bytes() for file in sorted(files)))
