"""Many small values of a pure function, kept line by line in one file: the evaluations of a search."""

import json
import math
import os
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from warnings import warn

import numpy as np

from hexmj.checks import numbers, path_of, typed
from hexmj.errors import InputError
from hexmj.storage.files import opened
from hexmj.sweeps.cells import Cell, check_unchanged, unlike
from hexmj.user_code.opened_files import serves


class KeptValues:
    """A function of rows that never computes one twice, in this run or in a later one.

    It is called as `function(rows, **settings)`, (row, number) -> (row,), and must treat every row by itself.  The file
    begins with the cell's record; every further line is a row, its value, what else was read for it, and a checksum.
    Lines are only ever added, by several runs at once if need be; one that is not whole, or whose files are others
    today, counts as if it were not there.
    """

    def __init__(self, cell: Cell, folder: Path | str | None = None, *, threads: int | None = None) -> None:
        """Begin with what the folder holds.

        Args:
            cell: function, settings and name.
            folder: keeps the file; None keeps values in memory only.
            threads: for the function, if it takes them.

        Raises:
            InputError: no cell or folder; the file is damaged in its first line, is of another cell, or cannot be read
                or written.
        """
        self._cell, self._threads = typed("cell", cell, Cell), threads
        self._values: dict[bytes, float] = {}
        self._read: dict[str, str] = {}
        self._not_kept = ""
        self._path, self._seed = None, 0
        if folder is not None:
            self._record = record = cell.record()
            self._seed = zlib.crc32(record.encode())
            self._path = path_of(folder) / f"{cell.stem(record)}.jsonl"
            self._begin(self._path, record)
        self._held = frozenset(self._values)
        self._replayed = set[bytes]()
        self.known = len(self._held)
        """Values that the file held."""

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """The values, (row,), of rows (row, number).

        Raises:
            InputError: no rows of numbers; the function gives no number for each; what it depends on has changed; the
                file is gone.

        Warns:
            UserWarning: values are not kept, or of a file that has changed since, as of `finish`.
        """
        rows = np.ascontiguousarray(numbers("rows", rows))
        if rows.ndim != 2 and len(rows):
            raise InputError(f"rows have the shape {rows.shape}; expected (row, number)")
        keys, by_a_cell = [row.tobytes() for row in rows], serves()
        self._replayed |= self._held.intersection(keys)
        new = {key: i for i, key in enumerate(keys) if key not in self._values}
        if new:
            picked = rows[list(new.values())]
            self._cell.tell({}, "", by_a_cell)  # counts even if it fails
            with self._cell.computing():
                given = self._cell.compute(picked, threads=self._threads)
            values = numbers(f"what {self._cell.name} gives", given)
            if values.shape != (len(picked),):
                raise InputError(
                    f"{self._cell.name} gives the shape {values.shape}; expected ({len(picked)},), one a row"
                )
            if self._path:
                check_unchanged(self._cell, self._record, self._cell.record())
                read, self._not_kept = self._cell.read()
                if told := unlike(self._cell.name, self._read, read):
                    warn(told, stacklevel=2)
                if self._not_kept:
                    warn(self._not_kept, stacklevel=2)
                    self._path = None
                else:
                    lines = (self._line(*one, read) for one in zip(new, values.tolist(), strict=True))
                    _add(self._path, "".join(lines))
            self._values |= zip(new, values.tolist(), strict=True)
        self._cell.tell(self._read, self._not_kept, by_a_cell)
        return np.array([self._values[key] for key in keys])

    @property
    def replayed(self) -> int:
        """Different rows that were asked for, and whose values the file held."""
        return len(self._replayed)

    def _begin(self, path: Path, record: str) -> None:
        first, lines = "", []
        if os.path.lexists(path):
            with opened(path) as file:
                first = file.readline(len(record.encode()) + 1).decode(errors="replace")
                if not f"{record}\n".startswith(first):
                    raise InputError(f"{path} is damaged, or of another search; delete it, and it is made anew")
                lines = file.read().decode(errors="replace").split("\n")
        current = cache(lambda told: self._cell.would_read(json.loads(told)))
        for line in lines:
            with suppress(ValueError, OverflowError, RecursionError):  # of what is no line
                row, value, told = f"{line.rpartition(' ')[0]} ".split(" ", 2)
                key, number, read = bytes.fromhex(row), float.fromhex(value), json.loads(told or "{}")
                whole = f"{line}\n" == self._line(key, number, read) and math.isfinite(number)
                if whole and current(told or "{}"):
                    self._values[key] = number
                    unlike(self._cell.name, self._read, read)  # nothing is: all of these are as they are today
        if rest := f"{record}\n"[len(first) :]:
            _add(path, rest, begin=True)

    def _line(self, row: bytes, value: float, read: dict[str, str]) -> str:
        """With a checksum that no line of another cell has."""
        text = f"{row.hex()} {value.hex()}{' ' + json.dumps(read, sort_keys=True) if read else ''}"
        return f"{text} {zlib.crc32(text.encode(), self._seed):08x}\n"


def _add(path: Path, text: str, begin: bool = False) -> None:
    """Append whole lines in one write, which a kill does not undo; after one that was torn, on a line of their own."""
    try:
        if begin:
            path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab+") as file:
            if not begin:
                if not file.seek(0, os.SEEK_END):
                    raise OSError("it was removed while it was in use")
                file.seek(-1, os.SEEK_END)
                text = text if file.read(1) == b"\n" else f"\n{text}"
            file.write(text.encode())
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
