"""Readings of the paper: all combinations, what each may and may not change, and how they are ranked."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.cli.commands import options_of
from hexmj.controllers.cruse1998 import HWS, LDVS, MODEL_VARIANTS, ModelVariant
from hexmj.errors import InputError
from hexmj.legs import CENTRED
from hexmj.measures.kinematic import walk
from hexmj.paper.claims import CLAIMS
from hexmj.paper.measurements import losses
from hexmj.paper.readings import (
    CALIBRATED,
    CHOICES,
    agreeing,
    choice_in,
    chosen,
    combinations,
    compare_readings,
    effects,
    gained,
    ranking,
    read,
    refined_as,
    title,
)
from hexmj.paper.readings_page import readings_markdown
from hexmj.paper.scores import IDEAL, REFINED_BY, REFINING, SCORING, judged, refined
from hexmj.starts import draw_starts
from hexmj.sweep import run_cells
from hexmj.timing import Acceleration, Stride

SMALL = replace(SCORING, **REFINING, sample=20, gait_starts=2)
STRIDE = Stride()


def test_all_choices_are_combined_and_what_is_printed_comes_first():
    model_variants = list(combinations(SCORING))
    assert len({(one.order, one.model_variant) for one in model_variants}) == len(model_variants) == 3 * 2 * 2 * 3 * 2
    assert model_variants[0] == SCORING
    assert title(model_variants[0]) == "as printed"
    assert replace(SCORING, model_variant=MODEL_VARIANTS["lasting"]) in model_variants
    assert len({title(one) for one in model_variants}) == len(model_variants)


def test_where_the_claims_come_from_that_decide():
    keys = {claim.key for claim in CLAIMS}
    assert keys >= {*REFINED_BY}
    assert {*REFINED_BY} <= CALIBRATED


@pytest.mark.thorough
@pytest.mark.parametrize("controller", [HWS, LDVS])
def test_what_only_acceleration_knows_changes_no_other_walk(controller):
    starts, final = draw_starts(20, 3), replace(controller, model_variant=ModelVariant(neutral="final"))
    one, other = (walk(starts, as_read, 0.5, 60.0).x for as_read in (controller, final))
    assert np.array_equal(one, other)
    faster = Acceleration(rate=0.01)
    one, other = (walk(starts, as_read, 0.5, 60.0, acceleration=faster).x for as_read in (controller, final))
    assert np.array_equal(one, other) == (controller is HWS)  # whose neutral positions hang on no velocity


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("acceleration", [None, Acceleration(rate=0.005)])
def test_who_looks_once_a_period_sees_fewer_losses(late, acceleration):
    def lost(looks):
        how = {"stride": STRIDE, "acceleration": None if late else acceleration, "late": late, "looks": looks}
        return losses(0.6, (HWS, HWS), 300, 5, **how).lost.values

    seldom, always = lost("periods"), lost("steps")
    assert (seldom <= always).all()
    assert not seldom[1].any() or acceleration  # the observation time 'start' is shorter than a period
    assert 0 < seldom[0].sum() < always[0].sum()


def test_a_margin_leaves_out_the_ends_of_s():
    def lost(margin):
        return losses(0.3, (LDVS, LDVS), 1000, 5, STRIDE, None, False, margin=margin).lost.values

    assert not np.array_equal(lost(0.0), lost(1.0))
    with pytest.raises(InputError):
        lost(10.0)


@pytest.mark.thorough
def test_refined_constants_miss_no_more(monkeypatch):
    monkeypatch.setattr("hexmj.paper.scores.ROUNDS", (({"aep0": 9.0, "pep0": -9.0},), ({"pep_min": -25.0},)))
    better, claims = refined(SMALL, threads=1), [claim for claim in CLAIMS if claim.key in REFINED_BY]
    before, after = (judged(claims, one, threads=1).miss.sum("claim").min().item() for one in (SMALL, better))
    assert after <= before
    assert replace(better, stride=STRIDE, gait_stride=STRIDE) == SMALL


def scores_of(model_variants, agrees):
    """Made up: `agrees` says for each reading which of four claims do."""
    keys = ["hws-late", "ldvs-late", "hws-majority", "hws-0.4"]
    values = np.array(agrees, dtype=np.int8)[:, np.newaxis, :, np.newaxis] * np.ones((1, 2, 1, 2), dtype=np.int8)
    told = {"agrees": (("model_variant", "constants", "claim", "observation_time"), values)}
    told |= {"miss": (("model_variant", "constants", "claim", "observation_time"), np.where(values == 1, 0.0, 0.25))}
    lengths = {
        name: ("model_variant", np.full(len(model_variants), one))
        for name, one in (("aep0", 9.0), ("pep0", -9.0), ("pep_min", -25.0), ("centred", True))
    }
    axes = {"claim": keys, "observation_time": ["walk", "start"], "constants": ["inferred", "refined"]}
    return xr.Dataset(told | lengths, axes | {"model_variant": [title(one) for one in model_variants]})


def test_held_out_claims_rank_and_calibrated_ones_do_not():
    model_variants = [SCORING, replace(SCORING, model_variant=MODEL_VARIANTS["lasting"]), replace(SCORING, order="undelayed")]
    scores = scores_of(model_variants, [[1, 0, 0, 1], [1, 1, 1, 0], [1, 0, 1, -1]])
    assert ranking(scores).tolist() == [1, 2, 0]
    assert agreeing(scores).sel(observation_time="walk", constants="inferred").values.tolist() == [1, 3, 2]
    assert agreeing(scores, held_out=False).sel(observation_time="walk", constants="inferred").values.tolist() == [1, 0, 0]
    assert gained(scores, "ipsilateral lasting", "walk") == (["ldvs-late", "hws-majority"], [])
    changed = effects(scores, model_variants).sel(observation_time="start")
    assert changed.sel(choice="ipsilateral lasting").item() == 3
    assert changed.sel(choice="order printed").item() == 2
    better = refined_as(model_variants[1], scores.isel(model_variant=1))
    assert better.stride == better.gait_stride == Stride(aep0=9.0, pep0=-9.0, pep_min=-25.0, geometry=CENTRED)
    closer = {"aside_agrees": (("best", "aside", "claim", "observation_time"), np.ones((1, 1, 4, 2), dtype=np.int8))}
    closer |= {"ideal_agrees": (("best", "ideal_claim", "observation_time"), np.ones((1, 2, 2), dtype=np.int8))}
    closer |= {"ideal_flss": (("best", "ideal_velocity"), np.full((1, 1), 0.0123))}
    told = {"best": ["ipsilateral lasting"], "aside": ["margin 1.0"], "ideal_velocity": [0.1]}
    page = readings_markdown(scores.assign(closer).assign_coords(told), model_variants)
    assert "| ipsilateral lasting | 3 / 3 | 3 / 3 | 0 / 0 | 0.25 / 0.25 | 9, -9, -25, centred |" in page
    assert "gains ldvs-late, hws-majority; loses none" in page
    assert "| ipsilateral lasting | 2 of 2 | 0.0123 |" in page
    assert len(hexmj.plot(scores.assign_attrs(study="model_variants")).axes) == len(CHOICES)


@pytest.fixture
def scored_at_once(monkeypatch):
    """Every score is made up, and none kept."""
    one = scores_of([SCORING], [[1, 0, 0, 1]]).isel(model_variant=0, drop=True)
    as_is = one[["agrees", "miss"]].isel(constants=0, drop=True)
    ideal = as_is.isel(claim=[0]).assign(flss=("ideal_velocity", [0.5])).assign_coords(ideal_velocity=[0.1])
    for name, made in {"score": one, "score_as_is": as_is, "score_of_ideals": ideal}.items():
        monkeypatch.setattr(f"hexmj.paper.readings.{name}", lambda protocol, made=made: made)
    monkeypatch.setattr("hexmj.paper.readings.run", lambda cells, folder, **how: run_cells(cells, **how))


@pytest.mark.parametrize("count", [2, 72])
def test_progress_comes_to_one_and_the_result_tells_what_it_was_made_with(scored_at_once, count):
    told = []
    model_variants = list(combinations(SMALL))[:count]
    scores = compare_readings(model_variants, 2, progress=told.append)
    assert sum(told) == pytest.approx(1.0)
    made_with = hexmj.settings(scores)
    assert {name: made_with[name] for name in ("study", "starts", "gait_starts", "seed", "best")} == {
        **{"study": "model_variants", "starts": 20, "gait_starts": 2},
        **{"seed": 1998, "best": 2},
    }
    assert ("## What a choice alone changes" in readings_markdown(scores, model_variants)) == (count == 72)


def test_json_tells_the_settings_and_every_number(scored_at_once, tmp_path, capsys):
    options_of(["model_variants", "--json", "--only", "lasting", "--starts", "30", "--out", str(tmp_path / "new")]).run()
    told, saved = json.loads(capsys.readouterr().out), hexmj.load(tmp_path / "new" / "readings.nc")
    assert told["settings"]["starts"] == 30 and told["settings"]["only"] == ["lasting"]
    assert hexmj.settings(saved)["only"] == ["lasting"]
    assert told["agrees"] == saved.agrees.values.tolist()
    assert {*saved.variables} < {*told}
    assert [row["model_variant"] for row in told["model_variants"]] == ["as printed", "ipsilateral lasting"]


def test_choices_are_read_and_titled():
    one = read(SCORING, {"order": "undelayed", "cap": "sum", "looks": "periods", "margin": 1.0})
    assert title(one) == "order undelayed, cap sum, looks periods, margin 1.0"
    assert (one.order, one.model_variant, one.looks, one.margin) == ("undelayed", ModelVariant(cap="sum"), "periods", 1.0)
    for one in combinations(SCORING):
        assert {name: choice_in(title(one), name) for name in CHOICES} == {name: chosen(one, name) for name in CHOICES}


@pytest.mark.parametrize(
    "words",
    [
        ["--only", "wrong"],
        ["--best", "0"],
        ["--only", "printed", "--best", "2"],
        ["--only"],
        ["--starts", "0"],
        ["--gait-starts", "0"],
        ["--seed", "-1"],
        ["--seed", "0"],
    ],
)
def test_bad_options_are_refused(words, tmp_path):
    with pytest.raises(InputError, match=r"expected|valid names"):
        options_of(["model_variants", *words, "--out", str(tmp_path)]).run()


@pytest.mark.thorough
def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("hexmj.paper.scores.ROUNDS", ())
    monkeypatch.setattr("hexmj.paper.scores.IDEAL", replace(IDEAL, budget=12))
    monkeypatch.setattr("hexmj.paper.readings.ASIDE", {"margin": (0.0, 1.0)})
    sizes = ["--starts", "10", "--gait-starts", "2", "--only", "printed"]
    options_of(["model_variants", *sizes, "--out", str(tmp_path)]).run()
    assert "as printed" in capsys.readouterr().out
    assert {"readings.md", "readings.nc", "readings.png", "manifest.json"} <= {one.name for one in tmp_path.iterdir()}
