"""Variants: each changes one constant or rule, and a search over them costs what the variants lose."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj import LDVS, InputError, NetworkForm, Problem, SensoryFeedback, Stride
from hexmj.controllers.cruse1998 import ModelVariant
from hexmj.legs import CENTRED
from hexmj.search.problems import Sample
from hexmj.variants import VARIANTS, variants, varied

FIELDS = ("aep0", "pep0", "pep_min", "dt", "geometry", "order", "ipsilateral", "contralateral", "cap")


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_variant_changes_one_thing(variant):
    changed = [
        name
        for usual, other in ((part, varied(part, variant)) for part in (Stride(), LDVS, ModelVariant()))
        for name in FIELDS
        if getattr(usual, name, None) != getattr(other, name, None)
    ]
    assert changed == list(VARIANTS[variant])
    assert len(changed) == (variant != "usual")


def test_a_part_with_the_changed_value_gets_the_default():
    lasting = hexmj.PRESETS["lasting-0.3"]
    assert varied(lasting, "lasting").model_variant == ModelVariant()
    assert varied(replace(LDVS, order="sequential"), "sequential").order == "printed"
    assert varied(Stride(pep_min=-15.0), "PEP_min -15") == Stride()
    assert varied(Stride(geometry=CENTRED), "centred") == Stride()


def test_a_controller_with_feedback_is_varied_within():
    assert varied(SensoryFeedback(LDVS), "undelayed") == SensoryFeedback(replace(LDVS, order="undelayed"))


def test_unknown_variants_and_impossible_values_are_errors():
    with pytest.raises(InputError, match="variant"):
        varied(LDVS, "nothing")
    with pytest.raises(InputError, match="pep0"):
        varied(Stride(aep0=20.0, pep0=9.5), "AEP0 9")


@pytest.mark.parametrize("over", ["mean", "worst"])
def test_a_search_over_variants_costs_what_they_lose(over):
    problem = Problem(form := NetworkForm("hws"), 0.5, 0.5, observation_time="start", over=over)
    vector = form.vector(hexmj.HWS)
    flss = [
        hexmj.flss(varied(form.controller(vector), name), 0.5, n_starts=40, seed=3, observation_time="start",
                   stride=varied(Stride(), name)).flss.item()
        for name in variants()
    ]  # fmt: skip
    expected = np.mean(flss) if over == "mean" else max(flss)
    assert Sample(problem, 40, 3).costs(vector[None]) == pytest.approx([expected])


@pytest.mark.slow
def test_the_example_prints_a_table(tmp_path):
    words = ["--controllers", "ldvs", "own-V", "--velocities", "0.5", "--n-starts", "4", "--observation-time", "start"]
    script = Path(__file__).parents[1] / "examples" / "variants.py"
    done = subprocess.run([sys.executable, script, *words], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in variants())
    assert (tmp_path / "results/variants/variants.nc").exists()
