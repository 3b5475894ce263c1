"""Ablation: controllers without one of their parts."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.controllers.cruse1998 import network_toml
from hexmj.controllers.cruse1998.weights import general
from hexmj.errors import InputError
from hexmj.measures.kinematic import first_loss
from hexmj.plotting import FEWER, NOTHING
from hexmj.studies.ablation import Ablation, ablation_figure, switched, wholes
from hexmj.sweep import run_study


def test_what_can_be_switched_is_what_makes_a_difference() -> None:
    assert list(switched("ldvs")) == [
        "ldvs",
        *(f"ldvs-{how}" for how in ("without-1", "without-3", "without-4", "with-2")),
    ]
    assert list(switched("walknet")) == ["walknet", *(f"walknet-without-{rule}" for rule in (1, 2, 3))]
    assert "walknet-load-without-5" in switched("walknet-load")
    with pytest.raises(InputError, match="controller"):
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


@pytest.mark.slow
def test_differences_are_those_to_the_whole_on_the_same_starts() -> None:
    study = Ablation(switched("walknet"), (0.5,), n_starts=20, physical_starts=2, periods=12)
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
    assert len(ablation_figure(result).axes) == 4
    at = {"controller": "walknet-without-1", "measure": "physical"}
    for starts, mark in ((1, FEWER), (0, NOTHING)):  # missing walks have a mark, never nan
        changed = result.copy(deep=True)
        changed.frequency_starts.loc[at] = starts
        for name in ("frequency", "more", "more_low", "more_high") if not starts else ():
            changed[name].loc[at] = np.nan
        figure = ablation_figure(changed)
        texts = [[text.get_text() for text in axes.texts] for axes in figure.axes]
        assert [sum(mark in text for text in panel) for panel in texts] == [0, 0, 0, 1]
        assert "nan" not in str(texts) and mark in figure.get_supxlabel()


def test_a_file_is_called_by_its_short_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("somewhere").mkdir()
    Path("somewhere/found.toml").write_text(network_toml(hexmj.LDVS))
    models = wholes(["somewhere/found.toml"])
    assert [*models][:2] == ["found", "found-without-1"]
    assert models["found-without-1"] == hexmj.load_controller("somewhere/found.toml-without-1")


@pytest.mark.parametrize("name", ["ldvs-without-2", "ldvs-without-7", "walknet-with-2", "graham-without-1"])
def test_what_cannot_be_switched_is_refused(name: str) -> None:
    with pytest.raises(InputError):
        hexmj.load_controller(name)


def test_other_model_variants_are_named_in_the_title() -> None:
    study = Ablation(wholes(["lasting", "walknet"]), (0.5,), n_starts=2, physical_starts=1, periods=12)
    lost = xr.Dataset(dict.fromkeys(("lost", "fell", "stable"), ("start", [0, 1])))
    result = study.result([lost for _ in study.cells()])
    assert "lasting (model variant lasting)" in hexmj.plot(result).texts[1].get_text().replace(
        "\N{NO-BREAK SPACE}", " "
    )
