"""Dynamic stability maps: cells are the package's own measures, differences are paired, what is done is not redone."""

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj.cli import main
from hexmj.comparison import compare
from hexmj.errors import InputError
from hexmj.experiments import stability_map as module
from hexmj.experiments.mechanisms import MECHANISMS, SAVED
from hexmj.experiments.stability_map import CONDITIONS, FLSS, froude, stability_map
from hexmj.intervals import paired_difference
from hexmj.parameters import LDVS
from hexmj.physics.body import Body

SMALL: dict[str, Any] = {"values": [80.0, 320.0], "velocities": [0.5, 0.7], "starts": 12, "window": 60.0}
SHORTER: dict[str, Any] = {"values": [320.0]}
OTHER_SEED: dict[str, Any] = {"seed": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("map")


@pytest.fixture(scope="module")
def result(folder):
    return stability_map(LDVS, "vp", folder, **SMALL)


def test_cells_are_those_of_the_comparison(result):
    for vp in result.value.values:
        alone = compare(LDVS, [0.5, 0.7], starts=12, window=60.0, body=Body(vp=vp)).isel(model=0)
        for name in ("planned_loss", "measured_loss", "fall", "tilt", "kinematic", "physical", "physical_high"):
            assert np.array_equal(result[name].sel(value=vp).values, alone[name].values), name


def test_every_number_has_a_unit(result):
    assert all("units" in variable.attrs for variable in result.data_vars.values())
    assert result.fall.attrs["units"] == "time unit"


def test_counts_add_up_to_the_frequencies(result):
    count, size = result["count"], result.sizes["start"]
    assert (count.sum("mechanism_name") == size).all()
    saved = count.sel(mechanism_name=list(SAVED)).sum("mechanism_name")
    assert_allclose((saved / size).values, (result.saved * result.static).values)
    fell = size - saved - count.sel(mechanism_name="never_lost")
    assert_allclose((fell / size).values, result.physical.values)
    assert_allclose(result.dynamics.values, (result.physical - result.static).values, atol=1e-12)
    assert_allclose(result.change.sel(value=result.attrs["reference"]), 0.0)


def test_the_kinematic_row_knows_no_condition(result):
    assert (result.kinematic == result.kinematic.isel(value=0)).all()
    assert (result.static == result.kinematic).all()
    assert not (result.physical == result.physical.isel(value=0)).all()


def test_what_is_finished_is_not_walked_again(result, folder, monkeypatch):
    monkeypatch.setattr(module, "physical_walk", None)
    again = stability_map(LDVS, "vp", folder, **SMALL)
    assert again.equals(result)
    part = stability_map(LDVS, "vp", folder, **(SMALL | SHORTER))
    assert np.array_equal(part.fall.values[0], result.fall.sel(value=320.0).values)
    with pytest.raises(TypeError):
        stability_map(LDVS, "vp", folder, **(SMALL | OTHER_SEED))


def test_same_bits_in_any_blocks_and_threads(result, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "BLOCK", 5)
    other = stability_map(LDVS, "vp", tmp_path, **SMALL, threads=1)
    assert other.drop_vars("speed").equals(result.drop_vars("speed"))
    assert_allclose(other.speed, result.speed, rtol=1e-14)  # a mean, summed in another order


def test_starts_that_cannot_stand_are_left_out_everywhere(tmp_path):
    few: dict[str, Any] = {"velocities": [0.7], "starts": 8, "window": 20.0}
    animal = stability_map(LDVS, "centre_of_mass", tmp_path, values=[-9.4, 0.0], **few)
    paper = stability_map(LDVS, "centre_of_mass", tmp_path, values=[0.0], **few)
    assert paper.stand.item() == 8
    assert animal.stand.values.tolist() == [animal.sizes["start"], 8]
    assert 0 < animal.sizes["start"] < 8
    assert np.array_equal(animal.fall.sel(value=0.0), paper.fall.sel(start=animal.start, value=0.0))
    assert animal.static.sel(value=-9.4).item() > animal.kinematic.sel(value=-9.4).item()
    with pytest.raises(InputError, match="stands on six feet"):
        stability_map(LDVS, "load", tmp_path, values=[10.0], **few)


def test_the_froude_number_is_one_where_weight_only_just_holds_the_arc():
    height = 10.0
    assert_allclose(froude(Body(vp=np.sqrt(9810.0 * height) / 0.5, standing_height=height), np.array([0.5])), 1.0)
    assert_allclose(froude(Body(vp=160.0), np.array([0.3])), 4 * froude(Body(vp=80.0), np.array([0.3])))


def test_paired_differences():
    rng = np.random.default_rng(0)
    one, other = rng.random((2, 5, 4000)) < np.array([0.5, 0.3])[:, None, None]
    middle, low, high = paired_difference(one, other)
    assert_allclose(middle, one.mean(axis=1) - other.mean(axis=1))
    back, back_low, back_high = paired_difference(other, one)
    assert_allclose([back, back_low, back_high], [-middle, -high, -low])
    spread = (one.astype(float) - other).std(axis=1) / np.sqrt(4000)  # of the mean, for many starts
    assert_allclose(high - low, 2 * 1.96 * spread, rtol=0.01)
    same, low, high = paired_difference(one, one)
    assert_allclose(same, 0.0)
    assert (low < 0).all() and (high > 0).all()


def test_the_values_of_every_condition_make_sense():
    for name, condition in CONDITIONS.items():
        assert getattr(Body, name) in condition.values
        assert sorted(condition.values) == list(condition.values)
        for value in condition.values:
            assert getattr(replace(Body(), **{name: value}), name) == value
    assert set(FLSS) == {"kinematic", "measured", "physical", "static"}


@pytest.mark.parametrize(
    ("over", "changed", "message"),
    [
        ("wind", {}, "valid names: vp, step_height"),
        ("friction", {"values": [1.0, 1.0]}, "none of them twice"),
        ("friction", {"values": [-1.0]}, "expected a finite number of at least 0"),
        ("step_height", {"values": [20.0]}, "at most 14 mm"),
        ("vp", {"velocities": [1.0]}, "0 <= V < 1"),
        ("vp", {"starts": 0}, "at least 1"),
        ("vp", {"body": Body(feedback=True)}, "expected False"),
    ],
)
def test_bad_input_is_refused(tmp_path, over, changed, message):
    given: dict[str, Any] = {"values": [], "velocities": [0.5], "starts": 2} | changed
    with pytest.raises(InputError, match=message):
        stability_map(LDVS, over, tmp_path, **given)
    assert not list(tmp_path.iterdir())


def test_command(tmp_path, monkeypatch, capsys):
    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["hexmj", "map", *map(str, words)])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    words = ("--values", 80, "--velocities", 0.7, "--starts", 4, "--window", 20, "--out", tmp_path)
    code, out, _ = run(*words, "--json")
    told = json.loads(out)
    assert code == 0
    assert sum(told["count"][0][0]) == told["starts"] == 4
    assert told["mechanism_name"] == list(MECHANISMS)
    names = {path.rsplit("/")[-1] for path in told["files"]}
    assert names == {"vp.nc", "vp.png", "vp-mechanisms.png", "vp-manifest.json"}
    assert all((tmp_path / name).stat().st_size for name in names)
    code, out, _ = run(*words)
    assert code == 0
    assert "landed in time" in out
    assert run(*words, "--vp", 20)[0] == 2
    assert run("--over", "wind")[0] == 2
