"""The command league: what its options come to, and what it writes and tells."""

from contextlib import nullcontext
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
import xarray as xr
from rich.console import Console

from hexmj.cli.commands import options_of
from hexmj.cli.tables import tables_that_fit
from hexmj.errors import InputError, RenderingError
from hexmj.studies.league import League

SMALL = "--starts 5 --physical-starts 1 --trial-starts 1 --velocities 0.5 --observation time 10 --no-video --out here"


def test_fewer_starts_on_paper_are_all_that_walk_unless_more_are_asked_for() -> None:
    few = options_of(["league", "--starts", "20"]).study()
    assert (few.n_starts, few.n_physical, few.n_tried) == (20, 20, 20)
    assert options_of(["ablate", "--starts", "20"]).study().n_physical == 20
    for command in ("league", "ablate"):
        with pytest.raises(InputError, match="n_physical = 4; expected at most n_starts = 2"):
            options_of([command, "--starts", "2", "--physical-starts", "4"]).study()
        with pytest.raises(InputError, match="n_physical = 0; expected a whole number of at least 1"):
            options_of([command, "--physical-starts", "0"]).study()


def test_a_quick_look_obeys_what_else_is_asked() -> None:
    quick, asked = (options_of(["league", "--quick", *words]).study() for words in ([], ["--starts", "1000"]))
    assert (quick.n_starts, quick.n_physical, quick.velocities) == (200, 8, (0.1, 0.5, 0.9))
    assert asked == replace(quick, n_starts=1000)
    assert options_of(["league"]).study().velocities == League.velocities


@pytest.mark.parametrize("option", ["--ground-height", "--ground-at", "--ground-length"])
def test_conditions_that_trials_bring_along_are_not_offered(option: str, capsys) -> None:
    with pytest.raises(SystemExit):
        options_of(["league", option, "5"])
    assert option in capsys.readouterr().err


def test_tables_are_as_wide_as_the_screen_and_break_no_cell(monkeypatch) -> None:
    head, rows = ("controller", *map(str, range(9))), [("a" * 20, *("0.123 (.01-.99)",) * 9)]
    for columns in (60, 80, 400):
        monkeypatch.setenv("COLUMNS", str(columns))
        lines = StringIO()
        for table in tables_that_fit(head, rows):
            Console(file=lines, width=columns).print(table)
        text = lines.getvalue()
        assert text.count("0.123 (.01-.99)") == 9 and all(name in text.split() for name in head)
        assert text.count("a" * 20) == -(-9 // ((columns - 20) // 17))


@pytest.mark.parametrize(("error", "stops"), [(InputError("no space"), True), (RenderingError("no space"), False)])
def test_a_film_that_cannot_be_written_stops_the_command_and_one_that_cannot_be_made_does_not(
    monkeypatch: pytest.MonkeyPatch, capsys, tmp_path: Path, error: Exception, stops: bool
) -> None:
    def filmed(*_: object) -> Path:
        raise error

    command = options_of(["league", "--out", str(tmp_path)])
    monkeypatch.setattr(type(command), "_filmed", filmed)
    monkeypatch.setattr("hexmj.cli.league.league_markdown", lambda _: "")
    with pytest.raises(InputError, match="no space") if stops else nullcontext():
        command.write_others(xr.Dataset())
    assert stops or capsys.readouterr().err == "hexmj: no video: no space\n"


@pytest.mark.thorough
def test_the_command_takes_a_controller_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    example = Path(__file__).parents[1] / "examples" / "tripod.py"
    options_of(["league", "--controllers", f"{example}:Tripod", "ldvs", *SMALL.split()]).run()
    shown = capsys.readouterr().out
    assert "Standings" in shown and "\ntripod " in shown
    assert {"league.nc", "league.png", "league_walks.png", "league.md", "manifest.json"} <= {
        one.name for one in Path("here").iterdir()
    }


FAR = """
from dataclasses import dataclass
import numpy as np
from hexmj.controllers.stepwise import Step, stepwise

@dataclass(frozen=True)
class Far:
    name: str = "far"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        y, stands = np.tile(3 * np.array(stride.geometry.y), (len(starts), 1)), np.ones(starts.shape, dtype=bool)
        return stepwise(lambda v: Step(starts, stands, y=y), starts, velocity, stride, acceleration)
"""


@pytest.mark.slow
def test_who_cannot_be_filmed_costs_neither_tables_nor_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("far.py").write_text(FAR)
    words = ["league", "--controllers", "graham-ideal", "far.py:Far", *SMALL.replace("--no-video", "").split()]
    options_of(words).run()
    shown = capsys.readouterr()
    assert "no video: " in shown.err and "Standings" in shown.out
    assert "below far on the same starts" in " ".join(shown.out.split()), "the first from random starts"
    written = {"league.nc", "league.png", "league_walks.png", "league.md", "manifest.json"}
    assert written == {one.name for one in Path("here").glob("*.*")}
