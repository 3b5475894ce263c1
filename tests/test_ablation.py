"""Ablation: controllers without one of their parts."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from coarse_steps import COARSE
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.cruse1998.weights import general
from hexmj.controllers.baselines.walknet import Walknet
from hexmj.errors import InputError
from hexmj.measures.kinematic import first_loss
from hexmj.studies.ablation import FEWER, NONE, Ablation, ablation_figure, switched, wholes
from hexmj.sweep import run_study


def test_what_can_be_switched_is_what_makes_a_difference() -> None:
    assert list(switched("ldvs")) == [
        "ldvs",
        *(f"ldvs-{how}" for how in ("without-1", "without-3", "without-4", "with-2")),
    ]
    assert list(switched("walknet")) == ["walknet", *(f"walknet-without-{rule}" for rule in (1, 2, 3))]
    assert "walknet-load-without-5" in switched("walknet-load")
    with pytest.raises(InputError, match="graham has no mechanisms"):
        switched("graham")


@pytest.mark.parametrize("name", ["ldvs", "own-0.3"])
def test_a_mechanism_that_is_switched_off_has_no_weights_and_the_others_keep_theirs(name: str) -> None:
    whole = general(hexmj.PRESETS[name].weights)
    for varied, controller in switched(name).items():
        assert isinstance(controller, hexmj.Cruse1998)
        how, _, which = varied.removeprefix(f"{name}-").rpartition("-")
        for kind in ("p1", "p2", "p31", "p32", "p33", "p34", "p4"):
            now, before = getattr(general(controller.weights), kind), getattr(whole, kind)
            if how == "without" and kind[1] == which:
                assert not now.any()
            elif not (how == "with" and kind[1] == which):
                assert np.array_equal(now, before)


def test_without_all_mechanisms_the_network_is_uncoordinated() -> None:
    nothing = hexmj.LDVS.without(1).without(3).without(4)
    starts = hexmj.draw_starts(50, 0)
    one, other = (first_loss(starts, controller, 0.3, 100.0) for controller in (nothing, hexmj.UNCOORDINATED))
    assert np.array_equal(one, other)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ldvs-without-2", "ldvs-without-2 is ldvs: expected a mechanism that makes a difference"),
        ("ldvs-without-7", "mechanism = 7; expected a whole number of at least 1 and at most 4"),
        ("ldvs-with-3", "ldvs with mechanism 3; expected 2 or 4"),
        ("walknet-without-5", "walknet without rule 5; expected one of 1, 2, 3"),
        ("walknet-with-2", "walknet has no mechanisms or rules that can be switched on; expected walknet-without-2"),
        ("graham-without-1", "graham has no mechanisms or rules that can be switched"),
        ("nobody-without-1", "'nobody' is neither one of"),
    ],
)
def test_what_cannot_be_switched_is_refused_in_a_sentence(name: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hexmj.load_controller(name)


@pytest.mark.parametrize("wrong", ["3", True, 2.0, np.array("2"), np.array([2]), None])
def test_mechanisms_and_rules_are_whole_numbers(wrong: Any) -> None:
    """And nothing that looks like one."""
    for without in (hexmj.LDVS.without, hexmj.LDVS.having, Walknet().without):
        with pytest.raises(InputError, match="expected a whole number"):
            without(wrong)
    three: Any = np.int64(3)
    assert hexmj.LDVS.without(three) == hexmj.LDVS.without(3)


@pytest.mark.thorough
def test_without_a_part_is_a_controller_like_any_other() -> None:
    check_controller(hexmj.load_controller("walknet-without-2"))


def test_a_controller_that_stands_twice_is_refused() -> None:
    for names in (("ldvs", "ldvs-without-3"), ("walknet-without-2", "walknet")):
        with pytest.raises(InputError, match=f"{max(names, key=len)} stands twice.*expected each controller once"):
            Ablation({name: switched(name) for name in names})


@pytest.mark.parametrize(
    ("models", "said"),
    [
        ({"ldvs": hexmj.LDVS}, "models\\['ldvs'\\] = Cruse1998"),
        ({"ldvs": {}}, "expected ldvs itself among them"),
        ({"ldvs": {"a": hexmj.LDVS}}, "expected ldvs itself among them"),
    ],
)
def test_models_that_make_no_sense_are_refused(models, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Ablation(models)


def test_a_contact_gap_is_refused_where_nobody_reads_it() -> None:
    from hexmj.cli.commands import options_of

    with pytest.raises(InputError, match="--contact-gap = 5 with falls only"):
        options_of(["ablate", "--contact-gap", "5"]).study()
    options_of(["ablate", "--contact-gap", "5", "--models", "ldvs", "walknet-load"]).study()


def test_whether_a_contact_gap_is_read_is_asked_at_a_velocity_that_is_walked() -> None:
    from hexmj.cli.commands import options_of

    for words in (["flss", "--physical"], ["terrain"], ["search", "--physical", "--velocity", "0.2"]):
        at = [] if "search" in words else ["--velocities", "0.2"]
        command = options_of([*words, *at, "--dt", "0.2", "--contact-gap", "5"])
        with pytest.raises(InputError, match="--contact-gap = 5 with falls only"):
            command.refuse_contact_gap(COARSE)


def test_whether_a_contact_gap_is_read_is_asked_of_walks_that_accelerate_where_they_do() -> None:
    from hexmj.cli.commands import options_of

    @dataclass(frozen=True)
    class Accelerating(Cruse1998):
        def begin(self, starts, velocity, stride, acceleration=None, threads=None):
            if acceleration is None:
                raise InputError("too fast at once")
            return super().begin(starts, velocity, stride, acceleration, threads)

    words = ["flss", "--physical", "--velocities", "0.7", "--acceleration", "0.01", "--contact-gap", "5"]
    with pytest.raises(InputError, match="--contact-gap = 5 with falls only"):
        options_of(words).refuse_contact_gap(Accelerating(hexmj.LDVS.weights, name="accelerating"))


@pytest.mark.thorough
def test_differences_are_those_to_the_whole_on_the_same_starts() -> None:
    study = Ablation({"walknet": switched("walknet")}, (0.5,), n_starts=20, n_physical=2, periods=12)
    result = run_study(study)
    assert not result.more.sel(controller="walknet").any()
    starts = hexmj.draw_starts(20, study.seed)
    lost = [
        np.isfinite(first_loss(starts, hexmj.load_controller(name), 0.5, 40.0)).mean()
        for name in ("walknet-without-1", "walknet")
    ]
    one = result.sel(controller="walknet-without-1", measure="start", velocity=0.5)
    assert one.frequency == lost[0] and np.isclose(one.more, lost[0] - lost[1])
    assert one.more_low < one.more < one.more_high
    figure = ablation_figure(result)
    assert len(figure.axes) == 4 and figure.get_supxlabel() == ""
    assert "20 starts, 2 in physics, 20 for the limit" in figure.get_suptitle()
    check_what_is_written(result)


def check_what_is_written(result: xr.Dataset) -> None:
    """Where walks are missing a mark stands, and where none is left a dash, never nan."""
    at = {"controller": "walknet-without-1", "measure": "physical"}
    for starts, mark, note in ((1, FEWER, "walks are missing"), (0, NONE, "no walk is left")):
        changed = result.copy(deep=True)
        changed.frequency_starts.loc[at] = starts
        for name in ("frequency", "more", "more_low", "more_high") if not starts else ():
            changed[name].loc[at] = np.nan
        figure = ablation_figure(changed)
        texts = [[text.get_text() for text in axes.texts] for axes in figure.axes]
        assert [sum(mark in text for text in panel) for panel in texts] == [0, 0, 0, 1]
        assert "nan" not in str(texts) and f"{mark} {note}" in figure.get_supxlabel()


def test_a_file_is_called_by_its_short_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("somewhere").mkdir()
    Path("somewhere/found.toml").write_text(network_toml(hexmj.LDVS))
    models = wholes(["somewhere/found.toml"])
    assert [*models] == ["found"] and [*models["found"]][:2] == ["found", "found-without-1"]
    assert models["found"]["found-without-1"] == hexmj.load_controller("somewhere/found.toml-without-1")


def test_sets_that_are_not_read_as_printed_are_told_once() -> None:
    study = Ablation(wholes(["lasting", "walknet"]), (0.5,), n_starts=2, n_physical=1, periods=12)
    lost = xr.Dataset({"lost": ("start", [0, 1])})
    result = study.result([lost for _ in study.cells()])
    assert hexmj.settings(result)["not_printed"] == {"reading lasting": ["lasting"]}
    assert "reading lasting: lasting; " in hexmj.plot(result).get_suptitle()


def test_parts_of_a_set_are_known_to_be_searched_on_these_starts() -> None:
    from hexmj.cli.commands import options_of

    for words in (["ablate", "--models", "own-0.3"], ["flss", "--model", "own-0.3-without-4"]):
        here, elsewhere = (options_of([*words, "--seed", seed]) for seed in ("0", "1999"))
        assert "a search found own-0.3 (" in here.conditions_line()
        assert (here.searched, elsewhere.searched) == ({"own-0.3": [0]}, {})
