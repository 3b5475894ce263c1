"""Cells computed one after another or on any executor, kept as they finish, and put together along named axes."""

import math
import os
import pickle
import socket
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypedDict, Unpack
from warnings import warn

from hexmj.checks import path_of, typed
from hexmj.errors import InputError
from hexmj.process.progress import Progress, shown
from hexmj.process.threads import thread_count
from hexmj.storage.files import marked, prepare, remove_leftovers
from hexmj.sweeps.cells import Cell, check_unchanged, difference
from hexmj.sweeps.cluster import has_given_up
from hexmj.sweeps.kept_cells import check_free, find, write
from hexmj.user_code.opened_files import heard

if TYPE_CHECKING:
    import xarray as xr

    Made = tuple[xr.Dataset, str]
    """The data of a cell, and why it is not kept; see `Cell.not_kept`."""


class Study(Protocol):
    """A frozen dataclass of settings that knows its cells and what they come to."""

    def cells(self) -> Sequence[Cell]:
        """All that is to be computed."""
        ...

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """What comes of the cells, given in their order."""
        ...


class Execution(TypedDict, total=False):
    """How cells are computed; what comes of them does not depend on it."""

    executor: Executor | None
    """Computes them, in threads, processes or, such as `Client.get_executor` of Dask, on other machines that see the
    folder; without one they are computed here, one after another."""
    progress: Progress | bool | None
    """True shows a bar; or a function that is told the fraction done since it was last called."""
    threads: int | None
    """For each cell; one per core unless given, and a single one with an executor."""


def conduct(study: Study, folder: Path | None = None, **how: Unpack[Execution]) -> "xr.Dataset":
    """The result of a study; arguments and errors as of `finish`."""
    cells = study.cells()
    before = [cell.settings_now() for cell in cells]
    result = study.result(run(cells, folder, **how))
    for cell, settings in zip(cells, before, strict=True):
        check_unchanged(cell, settings, cell.settings_now())
    return result


def run(cells: Sequence[Cell], folder: Path | None = None, **how: Unpack[Execution]) -> list["xr.Dataset"]:
    """What the cells give, in their order; arguments and errors as of `finish`."""
    with shown(how.get("progress"), "computing") as progress:
        found = dict(finish(cells, folder, **how | {"progress": progress}))
    return [found[i] for i in range(len(cells))]


def finish(
    cells: Sequence[Cell], folder: Path | None = None, **how: Unpack[Execution]
) -> Iterator[tuple[int, "xr.Dataset"]]:
    """Compute cells, and give each with its place as soon as it is there; the bits do not depend on who computes it.

    After an error, at Ctrl-C or when the caller goes away, cells that have not begun are cancelled; finished ones stay.

    Args:
        cells: to be computed; what is finished in the folder is not.
        folder: keeps a file for each cell, and several runs may work in it at once; None keeps nothing.
        how: see `Execution`.

    Raises:
        InputError: threads that are none; a cell cannot be named, sent, written or believed, what it depends on has
            changed meanwhile or is another where a worker is, or a worker was killed.  And whatever the first cell to
            fail raises.

    Warns:
        UserWarning: cells are not kept, since their code opens files that nothing names.
    """
    if unknown := set(how) - set(Execution.__annotations__):
        raise InputError(f"argument {min(unknown)!r}; valid names: {', '.join(Execution.__annotations__)}")
    folder = None if folder is None else path_of(folder).absolute()
    executor = typed("executor", how.get("executor"), Executor | None)
    progress = typed("progress", how.get("progress"), Progress | None)
    thread_count(threads := how.get("threads"))
    cells = [typed("a cell", cell, Cell) for cell in typed("cells", cells, Sequence)]
    records = [cell.record() if folder else "" for cell in cells]
    paths = [
        folder / f"{cell.stem(record)}.nc" if folder else None for cell, record in zip(cells, records, strict=True)
    ]
    if folder:
        finished_all = all(path and os.path.exists(path) for path in paths)
        (remove_leftovers if finished_all else prepare)(folder)
    share, warned = _Share(cells, progress), False
    if executor is None:
        made = (
            (i, _made(cell, paths[i], records[i], threads=threads, progress=partial(share.tell, i)))
            for i, cell in enumerate(cells)
        )
    else:
        made = _elsewhere(executor, cells, records, paths, folder, threads or 1)
    for i, (data, not_kept) in made:
        if not_kept and not warned:
            warned = True
            warn(not_kept, stacklevel=2)
        share.finish(i)
        yield i, data
    if folder:
        remove_leftovers(folder)  # once more: workers of one that was killed may have outlived its begin


def over_axes(sizes: Mapping[str, int], data: Sequence["xr.Dataset"], **concat: Any) -> "xr.Dataset":
    """The data of cells over named axes as one dataset.

    Args:
        sizes: axis -> how many cells lie along it; the last one runs fastest, as `itertools.product` has it.
        data: of all cells.
        concat: options of `xarray.concat`.
    """
    import xarray as xr

    if (count := math.prod(sizes.values())) != len(data):
        raise InputError(f"the data of {len(data)} cells along {dict(sizes)}; expected {count}")
    rows = list(data)
    for name, size in reversed(list(sizes.items())):
        rows = [xr.concat(rows[i : i + size], name, **concat) for i in range(0, len(rows), size)]
    (whole,) = rows
    return whole


class _Share:
    """Tells progress of what of all work each cell has done."""

    def __init__(self, cells: Sequence[Cell], progress: Progress | None) -> None:
        whole = sum(cell.work for cell in cells)
        self._parts, self._done, self._progress = [one.work / whole for one in cells], [0.0] * len(cells), progress

    def tell(self, i: int, done: float) -> None:
        """So much more of a cell is done."""
        self._done[i] += done
        if self._progress:
            self._progress(done * self._parts[i])

    def finish(self, i: int) -> None:
        """All of it."""
        self.tell(i, 1.0 - self._done[i])


def _made(cell: Cell, path: Path | None, record: str, **execution: Any) -> "Made":
    """A cell, computed and kept unless another run has done so; what is kept is given as it will be read."""
    import xarray as xr

    if path and (kept := find(path, record)) is not None:
        return kept, ""
    before = record if path else cell.settings_now()
    with heard() as opened:
        data = typed(f"what {cell.name} gives", cell.compute(**execution), xr.Dataset)
    check_free(cell.name, data)
    not_kept = check_unchanged(cell, before, cell.record() if path else cell.settings_now())
    not_kept = not_kept or (cell.not_kept(opened) if path or opened else "")
    return (write(path, record, data), "") if path and not not_kept else (data, not_kept if path else "")


@dataclass(frozen=True)
class _Parcel:
    """A cell on its way to a worker."""

    pickled: bytes
    record: str
    path: Path | None
    threads: int
    mark: Path | None = None
    """A file of the folder, which is there as long as somebody waits for the cell."""

    def compute(self) -> "Made":
        """The cell, by a worker that sees what the cell was sent from: files, code, packages and folder."""
        here = f"a worker on {socket.gethostname()}"
        try:
            cell = pickle.loads(self.pickled)
            record = cell.record()
        except InputError as error:
            raise InputError(f"{here}: {error}") from None
        except Exception as error:
            raise InputError(
                f"{here} cannot load a cell: {error}; expected the files and packages of the sender"
            ) from None
        if record != self.record:
            other = difference(self.record, record)
            raise InputError(
                f"{cell.name}: {here} has another {other} than the sender; start the worker again, in the same folder"
            )
        if self.mark and not self.mark.exists():
            raise InputError(
                f"{cell.name}: {here} does not see the folder {self.mark.parent}; expected it to be shared"
            )
        return _made(cell, self.path, record, threads=self.threads)


def _elsewhere(
    executor: Executor,
    cells: Sequence[Cell],
    records: Sequence[str],
    paths: Sequence[Path | None],
    folder: Path | None,
    threads: int,
) -> Iterator[tuple[int, "Made"]]:
    """What is kept, and then what an executor's workers make of the rest."""
    parcels = dict[int, _Parcel]()
    for i, (cell, record, path) in enumerate(zip(cells, records, paths, strict=True)):
        if path and (kept := find(path, record)) is not None:
            yield i, (kept, "")
        else:
            parcels[i] = _Parcel(_pickled(cell), record or cell.record(), path, threads)
    yield from _by_others(executor, parcels, folder)


def _by_others(executor: Executor, parcels: Mapping[int, _Parcel], folder: Path | None) -> Iterator[tuple[int, "Made"]]:
    """What an executor's workers make of parcels, each with its place, as soon as it is there."""
    futures: dict[Future[Made], int] = {}
    with marked(folder) if folder and parcels else nullcontext() as mark:
        try:
            for i, parcel in parcels.items():
                futures[_submitted(executor, replace(parcel, mark=mark))] = i
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenExecutor:
            raise InputError(
                "a process that computed cells was killed, or could not be started; what is finished is kept:"
                " start again, with fewer processes if the memory was full"
            ) from None
        except CancelledError:
            raise InputError(
                "what computed cells has gone away, as a scheduler that is stopped; what is finished is kept:"
                " start again"
            ) from None
        finally:
            for future in futures:
                future.cancel()


def _submitted(executor: Executor, parcel: _Parcel) -> "Future[Made]":
    if has_given_up(executor):
        raise InputError(f"executor = {executor!r:.80} has lost its scheduler; expected one of a client that has one")
    try:
        return executor.submit(parcel.compute)
    except BrokenExecutor:
        raise
    except RuntimeError as error:  # it was shut down
        raise InputError(f"executor = {executor!r:.80}: {error}") from None


def _pickled(cell: Cell) -> bytes:
    try:
        return pickle.dumps(cell)
    except Exception as error:
        raise InputError(f"{cell.name} cannot be sent to another process: {error}") from None
