"""Ledgers keep the evaluations of a search: no row is computed twice, and at most a torn line is lost."""

from pathlib import Path

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.sweep import CachedValues, Cell
from left_by_cells import calls


def squares(rows: np.ndarray, log: str) -> np.ndarray:
    with Path(log, "calls").open("a") as file:
        file.writelines(f"{row.tolist()}\n" for row in rows)
    return (rows**2).sum(axis=1) / 3


def ledger(tmp_path: Path, folder: Path | None = None) -> CachedValues:
    return CachedValues(Cell("squares", squares, {"log": str(tmp_path)}), folder or tmp_path / "kept")


def test_a_ledger_computes_no_row_twice_and_gives_the_same_bits(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).standard_normal((20, 5))
    first = ledger(tmp_path)
    values = np.concatenate([first(rows[:7]), first(rows[[3, 8, 8, 9]])[1:], first(rows[10:])])
    direct = (rows**2).sum(axis=1) / 3
    assert values.tobytes() == direct[[*range(7), 8, 8, 9, *range(10, 20)]].tobytes()
    again = ledger(tmp_path)
    assert again.known == 19
    assert again(rows).tobytes() == direct.tobytes()
    assert len(calls(tmp_path)) == 20
    assert ledger(tmp_path).known == 20


def test_a_ledger_loses_at_most_a_line_that_is_not_whole(tmp_path: Path) -> None:
    rows = np.random.default_rng(2).standard_normal((6, 3))
    values = ledger(tmp_path)(rows)
    (path,) = (tmp_path / "kept").iterdir()
    good = path.read_bytes()
    begin = good.index(b"\n") + 1
    for size in range(begin, len(good), 13):
        path.write_bytes(good[:size])
        again = ledger(tmp_path)
        assert again.known == good[: size + 1].count(b"\n") - 1
        assert again(rows).tobytes() == values.tobytes()
        assert ledger(tmp_path).known == 6
    for where in range(begin, len(good), 7):
        path.write_bytes(good[:where] + bytes([good[where] ^ 4]) + good[where + 1 :])
        again = ledger(tmp_path)
        assert again.known >= 4
        assert again(rows).tobytes() == values.tobytes()


def test_a_ledger_believes_no_line_of_another_and_no_number_that_is_none(tmp_path: Path) -> None:
    ledger(tmp_path)(np.ones((2, 2)))
    (path,) = (tmp_path / "kept").iterdir()
    other = CachedValues(Cell("squares", squares, {"log": str(tmp_path.parent)}), tmp_path / "other")
    record, lines = path.read_text().split("\n", 1)
    row = np.ones(2).tobytes()
    for line in (
        *map(other._line, [row, row], [3.0, -1.0], [{}, {}]),
        "zz 0x1p-1 00000000\n",
        "00\n",
        "00 0x1p9999 00000000\n",
        f"00 0x1p-1 {'[' * 100_000} 00000000\n",
        ledger(tmp_path)._line(row, np.nan, {}),
    ):
        path.write_text(f"{record}\n{line}")
        assert ledger(tmp_path).known == 0
    path.write_text(f"{record}\n{lines}")
    assert ledger(tmp_path).known == 1
    assert other._line(row, 1.0, {"b": "", "a": ""}) == other._line(row, 1.0, {"a": "", "b": ""})


def test_a_ledger_of_another_search_is_refused(tmp_path: Path) -> None:
    ledger(tmp_path)(np.ones((2, 2)))
    (path,) = (tmp_path / "kept").iterdir()
    path.write_bytes(path.read_bytes().replace(b"squares", b"circles", 1))
    with pytest.raises(InputError, match="is damaged, or of another search"):
        ledger(tmp_path)


def test_ledgers_of_two_runs_share_a_file(tmp_path: Path) -> None:
    one, other = ledger(tmp_path), ledger(tmp_path)
    for n in range(5):
        one(np.full((3, 2), float(n)))
        other(np.full((3, 2), n + 0.5))
    assert ledger(tmp_path).known == 10
