"""Cells computed one after another or on any executor, kept as they finish, and put together along named axes."""

import math
import os
import pickle
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol, TypedDict, Unpack
from warnings import warn

from hexmj.checks import path_of, short, typed, whole
from hexmj.errors import InputError
from hexmj.process.progress import Progress, shown
from hexmj.process.threads import thread_count
from hexmj.storage.files import marked, prepare, remove_leftovers
from hexmj.sweeps.cells import Cell, check_unchanged, difference, holds, unlike
from hexmj.sweeps.cluster import has_given_up
from hexmj.sweeps.kept_cells import check_free, find, write
from hexmj.sweeps.parcels import pickled_cell
from hexmj.user_code.opened_files import also_read, remembered, serves

if TYPE_CHECKING:
    import xarray as xr

    Made = tuple[xr.Dataset, dict[str, str], str]
    """The data of a cell, what else its code has read, and why it is not kept; see `Cell.read`."""

FAILED = "a cell that was swept elsewhere has failed: nobody knows what it has read; start the program again"
"""Why those who have swept it are not kept."""

_Task = tuple[Cell, str, Path | None]
"""A cell, its record and its file; empty and None where nothing is kept."""

_Parcel = Callable[[Path | None], "Made"]
"""A cell on its way to a worker, who calls it with the mark of the folder."""


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
    if isinstance(study, type) or not (hasattr(study, "cells") and hasattr(study, "result")):
        raise InputError(f"study = {short(study)}; expected one that has cells and a result")
    cells = [typed("a cell", cell, Cell) for cell in typed("cells", study.cells(), Sequence)]
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
        UserWarning: cells are not kept, since what their code has read has changed, or it runs what no import names, or
            has swept others that are not kept; or one has read a file that has changed since another one did.
    """
    if unknown := set(how) - set(Execution.__annotations__):
        also = ", ".join(Execution.__annotations__)
        raise InputError(f"argument {min(unknown)!r}; valid names: those that the call's help shows, and {also}")
    folder = None if folder is None else path_of(folder).absolute()
    executor = typed("executor", how.get("executor"), Executor | None)
    progress = typed("progress", how.get("progress"), Progress | None)
    thread_count(threads := how.get("threads"))
    cells = [typed("a cell", cell, Cell) for cell in typed("cells", cells, Sequence)]
    tasks: list[_Task] = [(cell, "", None) for cell in cells]
    if folder:
        tasks = [(cell, record := cell.record(), folder / f"{cell.stem(record)}.nc") for cell in cells]
        finished_all = all(path and os.path.exists(path) for _, _, path in tasks)
        (remove_leftovers if finished_all else prepare)(folder)
    work, done, warned = sum(cell.work for cell in cells), [0.0] * len(cells), False

    def tell(i: int, more: float) -> None:
        """So much more of a cell is done."""
        done[i] += more
        if progress:
            progress(more * (cells[i].work / work))

    if executor is None:
        made = ((i, _made(*task, threads=threads, progress=partial(tell, i))) for i, task in enumerate(tasks))
    else:
        made = _elsewhere(executor, tasks, folder, threads or 1)
    before, by_a_cell = dict[str, str](), serves()
    for cell in cells:
        cell.tell({}, "", by_a_cell)  # counts even if the cell fails
    for i, (data, read, not_kept) in made:
        cells[i].tell(read, not_kept, by_a_cell)
        if (told := unlike(cells[i].name, before, read) or (not_kept if folder else "")) and not warned:
            warned = True
            warn(told, stacklevel=2)
        tell(i, 1.0 - done[i])
        yield i, data
    if folder:
        remove_leftovers(folder)  # once more: workers of one that was killed may have outlived its begin


def over_axes(sizes: Mapping[str, int], data: Sequence["xr.Dataset"], **concat: Any) -> "xr.Dataset":
    """The data of cells over named axes as one dataset.

    Args:
        sizes: axis -> how many cells lie along it; the last one runs fastest, as `itertools.product` has it.
        data: of all cells.
        concat: options of `xarray.concat`.

    Raises:
        InputError: sizes that are none, an axis that the data have themselves, or data of another number of cells.
    """
    import xarray as xr

    for name, size in typed("sizes", sizes, Mapping).items():
        whole(f"size of {name}", size, 1)
        if any(name in one.dims for one in data):
            raise InputError(f"axis {name!r} of cells, whose data have one of that name; expected another name")
    if (count := math.prod(sizes.values())) != len(data):
        raise InputError(f"the data of {len(data)} cells along {dict(sizes)}; expected {count}")
    rows = list(data)
    for name, size in reversed(list(sizes.items())):
        rows = [xr.concat(rows[i : i + size], name, **concat) for i in range(0, len(rows), size)]
    (table,) = rows
    return table


def _kept(cell: Cell, record: str, path: Path) -> "Made | None":
    """What is kept of a cell, if its code would read today what it has read."""
    found = find(path, record)
    return (*found, "") if found and cell.would_read(found[1]) else None


def _made(cell: Cell, record: str, path: Path | None, **execution: Any) -> "Made":
    """A cell, computed and kept unless another run has done so; what is kept is given as it will be read."""
    import xarray as xr

    if path and (kept := _kept(cell, record, path)):
        return kept
    before = record if path else cell.settings_now()
    with cell.computing():
        data = typed(f"what {cell.name} gives", cell.compute(**execution), xr.Dataset)
    check_free(cell.name, data)
    check_unchanged(cell, before, cell.record() if path else cell.settings_now())
    read, not_kept = cell.read() if record else ({}, "")
    return write(path, record, read, data) if path and not not_kept else data, read, not_kept


def _made_by_a_worker(
    pickled: bytes, record: str, path: Path | None, threads: int, sender: tuple[str, int], mark: Path | None
) -> "Made":
    """A cell, by a worker that sees what it was sent from: files, code, packages, and the folder that holds `mark` as
    long as somebody waits."""
    here = f"a worker on {socket.gethostname()}"
    try:
        cell = pickle.loads(pickled)
        its_record = cell.record()
    except InputError as error:
        raise InputError(f"{here}: {error}") from None
    except Exception as error:
        raise InputError(f"{here} cannot load a cell: {error}; expected the files and packages of the sender") from None
    if its_record != record:
        other = difference(record, its_record)
        raise InputError(
            f"{cell.name}: {here} lacks or has another {other} than the sender; start it again, in the same folder"
        )
    if mark and not mark.exists():
        raise InputError(f"{cell.name}: {here} does not see the folder {mark.parent}; expected it to be shared")
    try:
        return _made(cell, record, path, threads=threads)
    except BaseException as error:
        if sender == _process() or _travels(error):
            raise
        told = f"{type(error).__name__}: {error}"
    raise RuntimeError(told)  # of which the error is no context, that something may want to pickle as well


def _process() -> tuple[str, int]:
    """This process, among those of all machines."""
    return socket.gethostname(), os.getpid()


def _travels(error: BaseException) -> bool:
    """Whether an error can be pickled and read again; else it would break a pool of processes."""
    try:
        return isinstance(pickle.loads(pickle.dumps(error)), BaseException)
    except Exception:
        return False


def _elsewhere(
    executor: Executor, tasks: Sequence[_Task], folder: Path | None, threads: int
) -> Iterator[tuple[int, "Made"]]:
    """What is kept, and then what an executor's workers make of the rest."""
    parcels = dict[int, _Parcel]()
    for i, (cell, record, path) in enumerate(tasks):
        if path and (kept := _kept(cell, record, path)):
            yield i, kept
        else:
            told = pickled_cell(cell), record or cell.record(), path, threads, _process()
            parcels[i] = partial(_made_by_a_worker, *told)
    yield from _by_others(executor, parcels, folder)


def _by_others(executor: Executor, parcels: Mapping[int, _Parcel], folder: Path | None) -> Iterator[tuple[int, "Made"]]:
    """What an executor's workers make of parcels, each with its place, as soon as it is there."""
    by_a_cell, futures = serves(), dict[Future["Made"], int]()
    done: SimpleQueue[Future[Made]] = SimpleQueue()  # hears of cancelled ones, too, as `as_completed` does not
    with marked(folder) if folder and parcels else nullcontext() as mark:
        try:
            for i, parcel in parcels.items():
                future = _submitted(executor, parcel, mark)
                futures[future] = i
                future.add_done_callback(done.put)
            for _ in parcels:
                future = done.get()
                try:
                    data, read, not_kept = future.result()
                    if other := [file for file in read if remembered(file) and not holds(file, read[file])]:
                        raise InputError(
                            f"a worker lacks or has another {other[0]} than the sender; start it where it has the same"
                        )
                except BaseException:
                    also_read(set(), FAILED, by_a_cell)
                    raise
                yield futures.pop(future), (data, read, not_kept)
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


def _submitted(executor: Executor, parcel: _Parcel, mark: Path | None) -> "Future[Made]":
    if has_given_up(executor):
        raise InputError(f"executor = {executor!r:.80} has lost its scheduler; expected one of a client that has one")
    try:
        future = executor.submit(parcel, mark)
    except BrokenExecutor:
        raise
    except RuntimeError as error:  # it was shut down
        raise InputError(f"executor = {executor!r:.80}: {error}") from None
    if not isinstance(future, Future):
        raise InputError(f"executor = {executor!r:.80} gave {short(future)}; expected a concurrent.futures.Future")
    return future
