"""How far long work has come: bars and lines, and that no result depends on them."""

import subprocess
import sys
import time
from functools import partial
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj import progress
from hexmj.errors import InputError
from hexmj.measures import kinematic
<<<<<<< HEAD
from hexmj.search.forms import NetworkForm
=======
from hexmj import progress
from hexmj.search.forms import NetworkForm
>>>>>>> a504e1a (Join the search into five modules; move its command's logic there)
from hexmj.search.stages import search
from hexmj.view import live
from tiers import few_of

STARTS = hexmj.draw_starts(2, 0)
CALLS: dict[str, Any] = {
    "flss": lambda **how: hexmj.flss(hexmj.LDVS, [0.5], n_starts=5, **how),
    "compare": lambda **how: hexmj.compare(hexmj.LDVS, [0.5], n_starts=2, observation_time=5.0, **how),
    "physical_flss": lambda **how: hexmj.physical_flss(hexmj.LDVS, [0.5], n_starts=2, observation_time=5.0, **how),
    "physical_walk": lambda **how: hexmj.physical_walk(STARTS, hexmj.LDVS, 0.5, 5.0, **how),
    "search": lambda **how: search(
        hexmj.Problem(NetworkForm("hws"), 0.4, 0.4, observation_time=20.0),
        hexmj.Effort(population=4, starts=5, budget=4, refine_starts=5, refine_budget=2),
        **how,
    ),
}


class Terminal:
    """A standard error that says it is a screen."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def isatty(self) -> bool:
        return True

    def flush(self) -> None: ...


@pytest.mark.parametrize("name", few_of(CALLS, "flss", "physical_walk"))
def test_true_shows_a_bar_and_changes_nothing(name: str, monkeypatch):
    screen, parts = Terminal(), list[float]()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    shown, told, without = (CALLS[name](progress=one) for one in (True, parts.append, False))
    assert "━" in screen.text or "\N{BOX DRAWINGS HEAVY TRIPLE DASH HORIZONTAL}" in screen.text
    assert sum(parts) == pytest.approx(1.0)
    if hasattr(shown, "identical"):
        assert shown.identical(told) and shown.identical(without)
    elif name == "physical_walk":
        np.testing.assert_array_equal(shown.qpos, told.qpos)
        np.testing.assert_array_equal(shown.qpos, without.qpos)


@pytest.mark.parametrize("name", CALLS)
def test_what_is_no_progress_is_refused_in_a_sentence(name: str):
    with pytest.raises(InputError, match=r"progress = 'yes'; expected a function or True or False or None"):
        CALLS[name](progress="yes")


def test_without_a_terminal_lines_are_printed(monkeypatch, capsys):
    """However seldom the work tells; nothing is printed of what is done at once."""
    monkeypatch.setattr(progress, "EVERY", 0.02)
    with progress.progress_bar("walking\n"):
        pass
    assert capsys.readouterr().err == ""
    with progress.progress_bar("walking\n") as told:
        told(0.5)
        deadline = time.monotonic() + 20.0
        while not (said := capsys.readouterr().err) and time.monotonic() < deadline:
            time.sleep(0.01)
    first = said.splitlines()[0]
    assert first.startswith(r"walking\n: 50% in 0 s, about 0 s to go")


def test_without_standard_error_nothing_is_printed(monkeypatch, capsys):
    monkeypatch.setattr(progress, "EVERY", 0.02)
    monkeypatch.setattr(sys, "stderr", None)
    with progress.progress_bar("walking"):
        time.sleep(0.3)
    assert capsys.readouterr().out == ""


def test_a_terminal_is_told_of_compiling_while_nothing_is_done(monkeypatch):
    """And no longer."""
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with progress.progress_bar("walking") as told:
        told(0.5)
        before = len(screen.text)
        time.sleep(0.3)
    assert progress.FIRST not in screen.text[before:]
    with progress.progress_bar("walking"):
        time.sleep(0.3)
    assert progress.FIRST in screen.text


@pytest.mark.slow
def test_a_command_without_a_terminal_prints_lines_on_standard_error():
    words = ["flss", "--starts", "2000", "--velocities", "0.5", "--json"]
    program = f"""
from time import sleep
from hexmj import progress
from hexmj.measures import kinematic
progress.EVERY, first_loss = 0.01, kinematic.first_loss
kinematic.first_loss = lambda *of, **how: (sleep(0.5), first_loss(*of, **how))[1]
import sys
sys.argv[1:] = {words!r}
from hexmj.cli.main import main
main()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    first, *others = done.stderr.splitlines()
    assert first == f"kinematic FLSS: 0% in 0 s; {progress.FIRST}"
    assert not any(progress.FIRST in line for line in others), "it is said once"
    assert done.stdout.startswith("{")


def _slowly(work, *of, **how):
    time.sleep(0.3)
    return work(*of, **how)


@pytest.mark.parametrize("words", [("view", "--browser", "--port", 0), ("walk",)])
def test_commands_without_lines_of_their_own_say_that_a_first_run_compiles(run, monkeypatch, tmp_path, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(progress, "EVERY", 0.1)
    monkeypatch.setitem(sys.modules, "viser", None)  # which ends a view once its insect stands
    for command, work in (kinematic, "walk"), (live, "LiveWalk"):
        monkeypatch.setattr(command, work, partial(_slowly, getattr(command, work)))
    _, _, error = run(*words)
    assert error.count(progress.FIRST) == 1


def test_a_notebook_shows_the_browsers_own_bar(monkeypatch):
    from IPython.core import interactiveshell

    states = list[str]()

    class Handle:
        def update(self, shown: Any) -> None:
            states.append(shown.data)

    def display(shown: Any, display_id: bool) -> Handle:
        states.append(shown.data)
        return Handle()

    class Shell:
        kernel = object()

    assert interactiveshell  # imported, as in a notebook
    monkeypatch.setattr("IPython.get_ipython", Shell)
    monkeypatch.setattr("IPython.display.display", display)
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    CALLS["flss"](progress=True)
    assert states[0] == f'computing <progress max="1" value="0.000"></progress> 0% {progress.FIRST}'
    assert states[-1].endswith(" 100%")
