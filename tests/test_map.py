"""Dynamic stability maps: cells are the package's own measures, differences are paired, what is done is not redone."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj import LDVS, Conditions, InputError, Stride, compare
from hexmj.studies import stability_map
from hexmj.studies.mechanisms import MECHANISMS, SAVED
from hexmj.studies.stability_map import CONDITIONS, FLSS, StabilityMap, froude
from hexmj.sweep import Cell, run_study

SMALL: dict[str, Any] = {"values": [80.0, 320.0], "velocities": [0.5, 0.7], "n_starts": 12, "observation_time": 60.0}
SHORTER: dict[str, Any] = {"values": [320.0]}
OTHER_SEED: dict[str, Any] = {"seed": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("map")


@pytest.fixture(scope="module")
def result(folder):
    return run_study(StabilityMap(LDVS, "vp", **SMALL), folder)


@pytest.mark.slow
def test_cells_are_those_of_the_comparison(result):
    for vp in result.value.values:
        alone = compare(LDVS, [0.5, 0.7], n_starts=12, observation_time=60.0, conditions=Conditions(vp=vp)).isel(
            controller=0
        )
        for name in ("planned_loss", "carried_loss", "fall", "tilt", "kinematic", "physical", "physical_high"):
            assert np.array_equal(result[name].sel(value=vp).values, alone[name].values), name


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
    monkeypatch.setattr(Cell, "compute", lambda *_, **__: pytest.fail("walked again"))
    assert run_study(StabilityMap(LDVS, "vp", **SMALL), folder).identical(result)
    part = run_study(StabilityMap(LDVS, "vp", **(SMALL | SHORTER)), folder)
    assert np.array_equal(part.fall.values[0], result.fall.sel(value=320.0).values)
    with pytest.raises(pytest.fail.Exception, match="walked again"):
        run_study(StabilityMap(LDVS, "vp", **(SMALL | OTHER_SEED)), folder)


@pytest.mark.slow
def test_same_bits_in_any_blocks_and_threads(result, monkeypatch):
    monkeypatch.setattr(stability_map, "BLOCK", 5)
    other = run_study(StabilityMap(LDVS, "vp", **SMALL), threads=1)
    assert other.drop_vars("speed").equals(result.drop_vars("speed"))
    assert_allclose(other.speed, result.speed, rtol=1e-14)  # a mean, summed in another order


def test_starts_that_cannot_stand_are_left_out_everywhere():
    few: dict[str, Any] = {"velocities": [0.7], "n_starts": 8, "observation_time": 20.0}
    animal = run_study(StabilityMap(LDVS, "centre_of_mass", [-9.4, 0.0], **few))
    paper = run_study(StabilityMap(LDVS, "centre_of_mass", [0.0], **few))
    assert paper.stand.item() == 8
    assert animal.stand.values.tolist() == [animal.sizes["start"], 8]
    assert 0 < animal.sizes["start"] < 8
    assert np.array_equal(animal.fall.sel(value=0.0), paper.fall.sel(start=animal.start, value=0.0))
    assert animal.static.sel(value=-9.4).item() > animal.kinematic.sel(value=-9.4).item()
    with pytest.raises(InputError, match="load"):
        run_study(StabilityMap(LDVS, "load", [10.0], **few))


def test_starts_whose_tips_are_out_of_reach_at_rest_are_left_out():
    wide: dict[str, Any] = {"n_starts": 8, "observation_time": 5.0, "stride": Stride(pep_min=-30.0, pep0=-25.0)}
    result = run_study(StabilityMap(LDVS, "vp", [80.0], [0.5], **wide))
    assert 0 < result.stand.item() == result.sizes["start"] < 8


def test_the_froude_number_is_one_where_weight_only_just_holds_the_arc():
    vp = np.sqrt(9810.0 * 10.0) / 0.5
    assert_allclose(froude(Conditions(vp=vp, standing_height=10.0), np.array([0.5])), 1.0)
    slow, fast = (froude(Conditions(vp=vp), np.array([0.3])) for vp in (80.0, 160.0))
    assert_allclose(fast, 4 * slow)


def test_the_values_of_every_condition_make_sense():
    for name, condition in CONDITIONS.items():
        assert Conditions().values()[name] in condition.values
        assert sorted(condition.values) == list(condition.values)
        for value in condition.values:
            varied: Any = {name: value}
            assert Conditions(**varied).values()[name] == value
    assert set(FLSS) == {"kinematic", "dynamic", "grounded", "carried", "physical", "static"}


@pytest.mark.slow
def test_command(tmp_path, run):
    words = ("map", "--values", 80, "--velocity", 0.7, "--starts", 4, "--observation-time", 20, "--out", tmp_path)
    code, out, _ = run(*words, "--json")
    told = json.loads(out)
    assert code == 0
    assert sum(told["count"][0][0]) == told["starts"] == 4
    assert told["mechanism_name"] == list(MECHANISMS)
    names = {Path(path).name for path in told["files"]}
    assert names == {"vp.nc", "vp.png", "vp-mechanisms.png", "vp-manifest.json"}
    assert all((tmp_path / name).stat().st_size for name in names)
    code, out, _ = run(*words)
    assert code == 0
    assert "landed in time" in out
    assert run(*words, "--vp", 20)[0] == 2
    assert run("map", "--over", "wind")[0] == 2
