"""Progress: bars and lines on standard error, on which no result depends."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj import progress
from hexmj.sweep import Cell, run_cells
from small_cells import NOW, reporting

STARTS = hexmj.draw_starts(2, 0)
CALLS = {
    "flss": lambda **how: hexmj.flss(hexmj.LDVS, [0.5], n_starts=5, **how).flss,
    "compare": lambda **how: hexmj.compare(hexmj.LDVS, [0.5], n_starts=2, observation_time=5.0, **how).fall,
    "physical_walk": lambda **how: hexmj.physical_walk(STARTS, hexmj.LDVS, 0.5, 5.0, **how).qpos,
}


class Terminal:
    """A standard error that is a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def isatty(self) -> bool:
        return True

    def flush(self) -> None: ...


@pytest.mark.parametrize("name", CALLS)
def test_a_bar_changes_no_result_and_progress_adds_up_to_one(name: str, monkeypatch):
    screen, parts = Terminal(), list[float]()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with_bar, with_function, without = (CALLS[name](progress=how) for how in (True, parts.append, False))
    assert "0 %" in screen.text and "left" in screen.text
    assert sum(parts) == pytest.approx(1.0)
    np.testing.assert_array_equal(with_bar, with_function)
    np.testing.assert_array_equal(with_bar, without)


def test_without_a_terminal_the_state_is_printed_now_and_then(monkeypatch, capsys):
    monkeypatch.setattr(progress, "EVERY", 0.02)
    with progress.progress_bar("walking") as advance:
        for _ in range(10):
            advance(0.1)
            __import__("time").sleep(0.01)
    states = capsys.readouterr().err.split("\r")
    assert 1 <= sum("walking: " in state for state in states) <= 10 and "left" in states[1]


def test_work_that_ends_at_once_prints_nothing(capsys):
    with progress.progress_bar("walking") as advance:
        advance(1.0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("cached", [0, 10])
def test_the_time_left_is_right_also_after_a_resumption(cached: int, tmp_path: Path, monkeypatch, capsys):
    cells = [Cell(f"{i}", reporting, {"seed": i, "seconds": s}, work=s) for i, s in enumerate([80.0, 10.0] * 10)]
    run_cells(cells[:cached], tmp_path)
    for place in ("time.time", "tqdm.std.time"):
        monkeypatch.setattr(place, lambda: NOW[0])
    with progress.progress_bar("computing") as advance:
        NOW[0] += 60.0  # the compilation
        run_cells(cells, tmp_path, progress=advance)
    found = re.findall(r"(\d+) %[^,]*?(\d+):(\d+), (\d+):(\d+) left", capsys.readouterr().err)
    states = [(int(part), 60 * int(a) + int(b), 60 * int(c) + int(d)) for part, a, b, c, d in found]
    whole = states[-1][1]
    assert states[-1][0] == 100 and whole == pytest.approx(sum(cell.work for cell in cells[cached:]), abs=25)
    for part, elapsed, left in states:
        assert part < 10 or left == pytest.approx(whole - elapsed, rel=0.3, abs=10)
