"""Who takes part in the league: found by name, named shortly, and refused where they make no sense."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.baselines.evolved import Evolved
from hexmj.controllers.baselines.metronomes import Metronome
from hexmj.controllers.baselines.phase_oscillators import PhaseOscillators
from hexmj.errors import InputError
from hexmj.studies.entrants import EVERYONE, Entrant, entrants, short_names
from hexmj.studies.league import League
from hexmj.studies.standings import TRIALS
from hexmj.timing import Stride
from standing_still import Still


def test_everyone_is_found_and_can_be_asked_everything() -> None:
    takes_part = entrants(EVERYONE)
    assert len(takes_part) == len(EVERYONE)
    named = League(takes_part).named_cells()
    for name, entrant in takes_part.items():
        asked = {what for one, what in named if one == name}
        assert "physics 0.5" in asked and "paper 0.5" in asked
        assert entrant.ideal != ({*TRIALS} <= asked)
    with pytest.raises(InputError, match="ideal start of ldvs"):
        entrants(("ldvs-ideal",))


OWN = """
from dataclasses import dataclass
from hexmj.controllers.baselines.metronomes import Metronome

@dataclass(frozen=True)
class One(Metronome):
    name: str = "one"

@dataclass(frozen=True)
class Ldvs(One):
    name: str = "ldvs"

@dataclass(frozen=True)
class Long(One):
    name: str = "one that has a very long name"

@dataclass(frozen=True)
class Bar(One):
    name: str = "a|b"
"""


def test_controllers_of_files_have_short_names_and_all_different_ones(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("a/b", "c/b"):
        Path(folder).mkdir(parents=True)
        Path(folder, "own.py").write_text(OWN)
        Path(folder, "found.toml").write_text(network_toml(hexmj.LDVS))
    expected = {
        "a/b/own.py:One": "a/b/own.py:One",
        "c/b/own.py:One": "c/b/own.py:One",
        "a/b/own.py:Ldvs": "own.py:Ldvs",
        "a/b/own.py:Long": "own.py:Long",
        "c/b/own.py:Bar": "own.py:Bar",
        "a/b/found.toml": "found",
        "ldvs-without-3": "ldvs-without-3",
        "ldvs": "ldvs",
    }
    assert short_names({name: hexmj.load_controller(name) for name in expected}) == expected
    takes_part = entrants(("a/b/own.py:One", "a/b/own.py:One-ideal", "graham-ideal"))
    assert [*takes_part] == ["one", "one-ideal", "graham-ideal"]
    assert [one.ideal for one in takes_part.values()] == [False, True, True]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: League({"ldvs": hexmj.LDVS}), "entrants\\['ldvs'\\] = .* expected an Entrant"),  # pyright: ignore
        (
            lambda: League(entrants(("ldvs",)), conditions=hexmj.Conditions(load=2.0)),
            "load = 2.0; expected 0.0, since",
        ),
        (
            lambda: League(entrants(("ldvs",)), conditions=hexmj.Conditions(ground="step")),
            "ground = 'step'; expected",
        ),
        (lambda: League(entrants(("ldvs",)), periods=0), "periods = 0; expected a whole number of at least 12"),
        (lambda: Entrant(hexmj.load_controller("graham"), "no"), "ideal = 'no'; expected True or False"),  # pyright: ignore
        (lambda: Metronome("tripod"), "wave = 'tripod'; valid names: wilson, graham"),  # pyright: ignore
        (lambda: PhaseOscillators(coupling=np.nan), "cpg-tripod: coupling = nan; expected a finite number"),
        (lambda: Evolved(theta=np.inf), "evolved: theta = inf; expected a finite number"),
        (lambda: Evolved(tau=1100.0), "evolved: tau = 1100.0; expected -1000 to 1000"),
    ],
)
def test_entrants_and_rivals_that_make_no_sense_are_refused(given, said: str) -> None:
    with pytest.raises(InputError, match=said):
        given()


def test_an_ideal_start_is_one_start() -> None:
    @dataclass(frozen=True)
    class Many(Still):
        def ideal_start(self, velocity, stride):
            return np.zeros((3, 6))

    with pytest.raises(InputError, match=r"still, ideal_start gave .* \(3, 6\); expected the tips of one start"):
        Entrant(Many(), ideal=True).starts(1, 0, 0.5, Stride())


def test_an_ideal_start_may_be_a_list_but_not_another_each_time() -> None:
    @dataclass(frozen=True)
    class Listed(Still):
        def ideal_start(self, velocity, stride):
            return [[1, 2, 3, 4, 5, -6]]

    assert Entrant(Listed(), ideal=True).starts(3, 0, 0.5, Stride()).tolist() == [[1.0, 2.0, 3.0, 4.0, 5.0, -6.0]]
    draws = np.random.default_rng(0)

    @dataclass(frozen=True)
    class Drawn(Still):
        def ideal_start(self, velocity, stride):
            return draws.uniform(-10.0, 10.0, (1, 6))

    with pytest.raises(InputError, match="still, ideal_start gave another start when it was asked again"):
        Entrant(Drawn(), ideal=True).starts(3, 0, 0.5, Stride())


def test_an_ideal_start_that_raises_is_one_sentence() -> None:
    @dataclass(frozen=True)
    class Gone(Still):
        def ideal_start(self, velocity, stride):
            raise ValueError("no gait at this velocity")

    with pytest.raises(InputError, match=r"still, ideal_start: ValueError in .*: no gait at this velocity"):
        Entrant(Gone(), ideal=True).starts(1, 0, 0.5, Stride())
