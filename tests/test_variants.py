"""Variants: the usual one is plain FLSS, each changes one thing, and a search over them costs what the study counts."""

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hexmj.studies.variants.figure import STYLES, variants_figure
from hexmj.studies.variants.study import Variants, notes

import hexmj
from hexmj import HWS, LDVS, Conditions, FieldsForm, InputError, NetworkForm, Problem, SensoryFeedback, Stride
from hexmj.controllers import Step, stepwise
from hexmj.controllers.cruse1998 import ModelVariant
from hexmj.legs import CENTRED
from hexmj.search.problems import Sample
from hexmj.sweep import Cell, run_study
from hexmj.variants import VARIANTS, instead, variants, varied

SMALL: dict[str, Any] = {"velocities": (0.5, 0.7), "n_starts": 60, "observation_time": "start", "seed": 4}
SETS = {"hws": (HWS, HWS), "own-V": (hexmj.PRESETS["own-0.5"], hexmj.PRESETS["own-0.7"])}


@dataclass(frozen=True)
class Stands:
    """Never moves."""

    pace: float = 1.0
    name: str = "stands"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        return stepwise(lambda v: Step(starts, np.ones(6, dtype=bool)), starts, velocity, stride, acceleration)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("variants")


@pytest.fixture(scope="module")
def result(folder):
    return run_study(Variants(SETS, **SMALL), folder)


@pytest.mark.slow
def test_a_figure_tells_of_the_stride_what_is_not_usual(result):
    assert "lines of the tips" not in variants_figure(result).get_suptitle()
    other = run_study(Variants(SETS, **SMALL, stride=Stride(geometry=CENTRED, aep0=9.5)))
    title = variants_figure(other).get_suptitle().replace("\N{NO-BREAK SPACE}", " ")
    assert "AEP$_0$ = 9.5 mm, other lines of the tips" in title


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_variant_changes_one_thing(variant):
    changed = [
        name
        for usual, other in ((part, varied(part, variant)) for part in (Stride(), LDVS, ModelVariant()))
        for name in ("aep0", "pep0", "pep_min", "dt", "geometry", "order", "ipsilateral", "contralateral", "cap")
        if getattr(usual, name, None) != getattr(other, name, None)
    ]
    assert changed == list(VARIANTS[variant])
    assert len(changed) == (variant != "usual")


@dataclass(frozen=True)
class Sequential(hexmj.Cruse1998):
    """An heir with a rule of its own by default."""

    order: Any = "sequential"


def test_what_an_heir_has_anyway_is_varied_to_what_the_network_has():
    heir = Sequential(LDVS.weights)
    assert varied(heir, "sequential").order == "printed"
    assert instead(heir, "sequential") == {"order": "printed"}
    assert varied(heir, "undelayed").order == "undelayed"


def test_what_has_the_changed_value_already_gets_the_usual_one():
    lasting = hexmj.PRESETS["lasting-0.3"]
    assert varied(lasting, "lasting").model_variant == ModelVariant()
    summed = ModelVariant(cap="sum")
    assert varied(replace(LDVS, model_variant=summed), "lasting").model_variant == replace(summed, ipsilateral="lasting")
    assert varied(replace(LDVS, order="sequential"), "sequential").order == "printed"
    assert varied(Stride(pep_min=-15.0), "PEP_min -15") == Stride()
    assert varied(Stride(geometry=CENTRED), "centred") == Stride()


@pytest.mark.thorough
def test_a_row_says_what_is_walked_where_a_set_has_the_variant_anyway():
    assert instead(LDVS, "lasting") == instead(Stride(), "dt 0.2") == {}
    lasting, sums = hexmj.PRESETS["lasting"], replace(LDVS, model_variant=ModelVariant(ipsilateral="lasting", cap="sum"))
    assert instead(SensoryFeedback(sums), "lasting") == {"ipsilateral": "standing"}
    few: dict[str, Any] = {"n_starts": 2, "observation_time": 3.0, "stride": Stride(dt=0.05, geometry=CENTRED)}
    walked = run_study(Variants({"ldvs": (LDVS, LDVS), "own": (LDVS, lasting)}, (0.3, 0.5), **few))
    told = {
        (name, variant, v): note
        for name in ("ldvs", "own")
        for variant in VARIANTS
        for v in (0.3, 0.5)
        if (note := walked.instead.sel(network=name, variant=variant, velocity=v).item())
    }
    both = {(name, v) for name in ("ldvs", "own") for v in (0.3, 0.5)}
    expected = {(name, "centred", v): "geometry = fig1" for name, v in both}
    expected |= {(name, "dt 0.05", v): "dt = 0.1" for name, v in both}
    assert told == expected | {("own", "lasting", 0.5): "ipsilateral = standing"}
    assert notes(walked) == [
        "* centred is usual for ldvs, own: walked with geometry = fig1 instead",
        "* dt 0.05 is usual for ldvs, own: walked with dt = 0.1 instead",
        "* lasting is usual for own: walked with ipsilateral = standing instead",
    ]
    assert "lasting is usual for own" in variants_figure(walked).get_supxlabel()


def test_a_controller_that_reads_the_legs_is_varied_within():
    assert varied(SensoryFeedback(LDVS), "undelayed") == SensoryFeedback(replace(LDVS, order="undelayed"))


def test_the_usual_variant_is_plain_flss(result):
    same = {"flss": "flss", "flss_low": "low", "flss_high": "high", "duration": "duration"}
    for name, networks in SETS.items():
        for network, v in zip(networks, SMALL["velocities"], strict=True):
            plain = hexmj.flss(network, [v], **{key: SMALL[key] for key in ("n_starts", "observation_time", "seed")})
            one = result.sel(network=name, velocity=v, variant="usual")
            for ours, theirs in same.items():
                assert one[ours].item() == plain[theirs].item()


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_is_plain_flss_of_what_it_changes(result, variant):
    how = {key: SMALL[key] for key in ("n_starts", "observation_time", "seed")}
    expected = hexmj.flss(varied(HWS, variant), [0.7], stride=varied(Stride(), variant), **how).flss.item()
    assert result.flss.sel(network="hws", velocity=0.7, variant=variant).item() == expected


@pytest.mark.parametrize(("over", "name"), [("mean", "mean"), ("worst", "worst")])
def test_a_search_over_variants_costs_what_the_study_counts(result, over, name):
    form = NetworkForm("general")
    sample = Sample(Problem(form, 0.5, 0.5, SMALL["observation_time"], over=over), SMALL["n_starts"], SMALL["seed"])
    sets = {key: networks[0] for key, networks in SETS.items()}
    expected = result[name].sel(velocity=0.5)
    costs = sample.costs(np.array([form.vector(one) for one in sets.values()]))
    np.testing.assert_allclose(costs, expected.sel(network=list(sets)).values, rtol=1e-12)
    verdict = sample.verdict(sets).sel(observation_time=SMALL["observation_time"])
    for ours, theirs in {"flss": name, "flss_low": f"{name}_low", "flss_high": f"{name}_high"}.items():
        np.testing.assert_allclose(verdict[ours].values, result[theirs].sel(velocity=0.5).values, rtol=1e-12)


def test_mean_and_worst_are_of_the_variants(result):
    np.testing.assert_allclose(result["mean"], result.flss.mean("variant"))
    assert (result.worst == result.flss.max("variant")).all()
    for name in SETS:
        one = result.sel(network=name, velocity=0.5)
        assert one.flss.sel(variant=one.worst_variant.item()) == one.worst
    assert (result["mean_low"] <= result["mean"]).all()
    assert (result["mean"] <= result["mean_high"]).all()


def test_what_is_finished_is_not_walked_again(result, folder, monkeypatch):
    monkeypatch.setattr(Cell, "compute", lambda *_, **__: pytest.fail("walked again"))
    assert run_study(Variants(SETS, **SMALL), folder).identical(result)
    others: dict[str, Any] = {**SMALL, "seed": 1}
    with pytest.raises(pytest.fail.Exception, match="walked again"):
        run_study(Variants(SETS, **others), folder)


def test_the_figure_tells_what_was_counted_as_far_as_it_is_known(result):
    assert variants_figure(result).get_suptitle().startswith("Kinematic FLSS with")
    falls = result.assign_attrs(conditions=json.dumps({"vp": 80.0}))
    assert variants_figure(falls).get_suptitle().startswith("Physical FLSS with")
    assert (
        "without AEP0 11, which the stick insect's legs do not reach on their usual lines"
        in variants_figure(falls).get_supxlabel()
    )
    del falls.attrs["conditions"]
    assert variants_figure(falls).get_suptitle().startswith("FLSS with")


def test_the_figure_shows_every_set_and_velocity(result):
    figure = variants_figure(result)
    assert [axes.get_title() for axes in figure.axes] == ["V = 0.5", "V = 0.7"]
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == list(SETS)
    assert all(name == "usual" or any(name.startswith(begin) for begin in STYLES) for name in VARIANTS)


@pytest.mark.parametrize("times", [0.0, 1.0])
def test_marks_are_whole_in_the_figure_where_nobody_or_everybody_loses(result, times):
    figure = variants_figure(result.assign(flss=times * (result.flss / result.flss.max()).round()))
    figure.savefig(BytesIO())
    for axes in figure.axes:
        left, right = axes.bbox.intervalx
        for mark in axes.lines:
            if mark.get_marker() not in ("|", "None"):
                at = axes.transData.transform(mark.get_xydata())[:, 0]
                half = mark.get_markersize() / 2 * figure.dpi / 72
                assert left < at.min() - half and at.max() + half < right


@pytest.mark.thorough
def test_the_insect_walks_the_variants_that_its_legs_reach():
    """On paper the other one is walked too."""
    assert set(variants()) - set(variants(physical=True)) == {"AEP0 11"}
    few: dict[str, Any] = {"velocities": (0.7,), "n_starts": 2, "observation_time": 20.0}
    walked = run_study(Variants({"ldvs": (LDVS,)}, conditions=Conditions(vp=200.0), **few))
    assert walked.variant.values.tolist() == variants(physical=True)
    assert notes(walked)[0] == "without AEP0 11, which the stick insect's legs do not reach on their usual lines"
    alone = hexmj.physical_flss(LDVS, [0.7], n_starts=2, observation_time=20.0, conditions=Conditions(vp=200.0))
    assert walked.flss.sel(variant="usual").item() == alone.flss.item()


def test_what_makes_no_sense_is_refused():
    with pytest.raises(InputError, match=r"over = 'mean' with .*; expected it with the 1998 network, whose rules vary"):
        Problem(FieldsForm(Stands()), 0.4, 0.4, over="mean")
    with pytest.raises(InputError, match=r"over = 'most'; valid names: usual, mean, worst"):
        Problem(NetworkForm(), 0.4, 0.4, over="most")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"pep_min = -15.0, pep0 = -16.0"):
        Problem(NetworkForm(), 0.4, 0.4, over="mean", stride=Stride(pep0=-16.0))
    with pytest.raises(InputError, match="ldvs: 1 networks; expected one for each of"):
        Variants({"ldvs": (LDVS,)}, (0.1, 0.2))
    with pytest.raises(InputError, match="no network was given"):
        Variants({})
    with pytest.raises(InputError, match=r"variant PEP0 -11: pep_min = -10.5, pep0 = -11.0"):
        Variants({"ldvs": (LDVS,)}, (0.1,), stride=Stride(pep_min=-10.5, pep0=-10.0))
    with pytest.raises(InputError, match=r"variant dt 0.2: .*expected at least one step, 0.2"):
        Variants({"ldvs": (LDVS,)}, (0.1,), observation_time=0.12)
    with pytest.raises(InputError, match=r"^.*expected at least one step, 0.1") as plain:
        Variants({"ldvs": (LDVS,)}, (0.1,), observation_time=0.05)
    assert "variant" not in str(plain.value)
    with pytest.raises(InputError, match="variant 'bogus'; valid names: usual, centred"):
        varied(LDVS, "bogus")


@pytest.mark.parametrize("networks", [LDVS, ["ldvs"], [None], "ldvs"], ids=repr)
def test_a_set_for_each_velocity_is_expected(networks):
    with pytest.raises(InputError, match=r"networks of l = .*; expected some values, each a Cruse1998"):
        Variants({"l": networks}, (0.5,))


@pytest.mark.thorough
def test_the_command_marks_what_is_walked_otherwise(run, tmp_path):
    words = ["variants", "--models", "lasting", "ldvs", "--velocities", 0.3, "--starts", 2, "--observation time", 3]
    code, out, _ = run(*words, "--out", tmp_path)
    (row,) = (line.split() for line in out.splitlines() if line.split()[:1] == ["lasting"] and "(" not in line)
    assert code == 0
    assert row[1].endswith("*")
    assert not row[2].endswith("*")
    assert "* lasting is usual for lasting" in out
    code, out, _ = run(*words, "--json", "--out", tmp_path)
    assert json.loads(out)["instead"][0][-1] == ["ipsilateral = standing"]


@pytest.mark.thorough
def test_the_command(run, result, tmp_path):
    words = ["variants", "--models", "hws", "own-V", "--velocities", 0.5, 0.7, "--starts", 60, "--observation time", "start"]
    code, out, _ = run(*words, "--seed", 4, "--json", "--out", tmp_path)
    told = json.loads(out)
    assert code == 0
    assert told["flss"] == result.flss.values.tolist()
    assert told["worst_variant"] == result.worst_variant.values.tolist()
    assert {path.name for path in tmp_path.iterdir()} >= {"variants.nc", "variants.png", "manifest.json"}


@pytest.mark.slow
def test_the_example_prints_a_table(tmp_path):
    words = ["--controllers", "ldvs", "own-V", "--velocities", "0.5", "--n-starts", "4", "--observation-time", "start"]
    script = Path(__file__).parents[1] / "examples" / "variants.py"
    done = subprocess.run([sys.executable, script, *words], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in variants())
    assert (tmp_path / "results/variants/variants.nc").exists()
