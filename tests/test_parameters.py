"""Weights, symmetric forms, presets and parameter files."""

import runpy
import shlex
import tomllib
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from hexmj.controllers.cruse1998 import (
    HWS,
    LDVS,
    MODEL_VARIANTS,
    PRESETS,
    Cruse1998,
    ModelVariant,
    Symmetric,
    Weights,
    network_toml,
)
from hexmj.controllers.cruse1998.presets import OWN
from hexmj.controllers.cruse1998.weights import NEIGHBOURS, PLACES, general
from hexmj.controllers.registry import load_controller
from hexmj.errors import InputError
from hexmj.legs import N1, N2, N3, N4, Geometry
from hexmj.measures.kinematic import flss, walk
from hexmj.starts import MOST_DRAWN, draw_starts
from hexmj.timing import Acceleration, Stride

ROOT = Path(__file__).parents[1]


def test_neighbours_are_the_paper_s():
    """Section 2, in the paper's own numbers."""
    paper_n1 = {1: {2, 4}, 2: {3, 5}, 3: {6}, 4: {5, 1}, 5: {6, 2}, 6: {3}}
    paper_n2 = {1: {2}, 2: {3}, 3: set(), 4: {5}, 5: {6}, 6: set()}
    paper_n3 = {1: {4}, 2: {1, 5}, 3: {2, 6}, 4: {1}, 5: {4, 2}, 6: {5, 3}}
    paper_n4 = {1: set(), 2: {1}, 3: {2}, 4: set(), 5: {4}, 6: {5}}
    for ours, paper in ((N1, paper_n1), (N2, paper_n2), (N3, paper_n3), (N4, paper_n4)):
        assert {d + 1: {e + 1 for e in sources} for d, sources in enumerate(ours)} == paper


def test_number_of_parameters():
    """58 for the LDVS form, 48 without P^{3,4} for the HWS form (Section 2): 10, 4, 40 and 4 by mechanism."""
    pairs = {kind: sum(map(len, n)) for kind, n in NEIGHBOURS.items()}
    assert pairs["p1"] == 10
    assert pairs["p2"] == pairs["p4"] == 4
    assert sum(pairs[kind] for kind in ("p31", "p32", "p33", "p34")) == 40
    assert sum(pairs.values()) == 58
    assert len(general(LDVS.weights).to_vector()) == 58
    assert 58 - pairs["p34"] == 48 and not general(HWS.weights).p34.any()


def test_appendix_a():
    weights, p = cast(Symmetric, LDVS.weights), general(LDVS.weights)
    assert p.p1[0, 1] == p.p1[4, 5] == weights.p1_i
    assert p.p1[0, 3] == p.p1[5, 2] == weights.p1_c
    assert p.p31[1, 0] == p.p31[5, 4] == weights.p31_i
    assert p.p32[3, 0] == p.p33[3, 0] == weights.p32_c
    assert p.p34[2, 1] == weights.p34_i
    assert p.p34[2, 5] == 0.0
    assert p.p4[1, 0] == 1.0


def test_files_give_the_same_walk_as_the_preset(tmp_path):
    symmetric = tmp_path / "symmetric.toml"
    symmetric.write_text("[symmetric]\n" + "\n".join(f"{k} = {v}" for k, v in vars(HWS.weights).items()))
    whole = tmp_path / "general.toml"
    tables = []
    for kind, neighbours in NEIGHBOURS.items():
        matrix = getattr(general(HWS.weights), kind)
        tables.append(f"[weights.{kind}]")
        tables += [f'"{d + 1},{e + 1}" = {matrix[d, e]}' for d, sources in enumerate(neighbours) for e in sources]
    whole.write_text("\n".join(tables))
    start = np.random.default_rng(0).uniform(-10, 10, (3, 6))
    expected = walk(start, HWS, 0.3, 80.0).x
    for path in (symmetric, whole):
        assert np.array_equal(walk(start, load_controller(str(path)), 0.3, 80.0).x, expected)


@pytest.mark.parametrize(
    "text",
    [
        "[symmetric]\np5_i = 1.0",
        "[symmetric]\np1_i = 'ten'",
        "[symmetric]\np2 = 0.5",
        "[other]\na = 1",
        "[weights.p9]\n'1,2' = 1.0",
        "[weights.p1]\n'1,6' = 1.0",
        "weights = 3",
        "order = 'random'\n[symmetric]",
        "model_variant = ['lasting']\n[symmetric]",
    ],
)
def test_invalid_files_are_refused(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"model\.toml"):
        load_controller(str(path))


def weights_with(**changed: np.ndarray) -> Weights:
    return Weights(**{kind: np.zeros((6, 6)) for kind in NEIGHBOURS} | changed)


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("lateral", lambda: Geometry(lateral=(18.0, 0.0, 15.0))),
        ("start", lambda: Acceleration(start=1.0)),
        ("rate", lambda: Acceleration(rate=0.0)),
        ("dt", lambda: Stride(dt=1e-6)),
        ("pep0", lambda: Stride(aep0=-11.0)),
        ("pep0", lambda: Stride(pep0=float("nan"))),
        ("n_starts", lambda: draw_starts(MOST_DRAWN + 1, 0)),
        ("p1", lambda: weights_with(p1=np.eye(6)[[5, 0, 1, 2, 3, 4]])),
        ("p1", lambda: weights_with(p1=np.zeros((5, 6)))),
        ("p31", lambda: weights_with(p31=np.full((6, 6), np.nan))),
        ("p1_i", lambda: Symmetric(p1_i=np.inf)),
        ("order", lambda: Cruse1998(HWS.weights, order=cast(Any, "random"))),
        ("weights", lambda: Cruse1998(cast(Any, "hws"))),
    ],
)
def test_invalid_settings_are_refused(name, make):
    with pytest.raises(InputError, match=name):
        make()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("observation_time", "names", "velocities"),
    [
        ("walk", ["own", "own-{}"], [0.1, 0.2, 0.5, 0.8]),
        ("start", ["own"], [0.2, 0.3, 0.5]),
        ("start", ["own-0.1"], [0.1]),
    ],
)
def test_our_own_sets_beat_the_papers(observation_time, names, velocities):
    """On fresh starts; over the observation time `start` LDVS is better than `own` at V = 0.1."""
    for v in velocities:
        own, papers = (
            [
                flss(PRESETS[name.format(v)], [v], seed=7, observation_time=observation_time).flss.item()
                for name in group
            ]
            for group in (names, ["hws", "ldvs"])
        )
        assert max(own) < min(papers)


def test_each_of_our_own_sets_names_the_command_that_found_it():
    table = tomllib.loads(OWN.read_text())
    assert set(PRESETS) - {"hws", "ldvs", "uncoordinated"} == set(table)
    for name, entry in table.items():
        program, what, *words = shlex.split(entry["command"])
        if program == "python":
            built = runpy.run_path(str(ROOT / what))["coupled"]()
            assert np.array_equal(general(PRESETS[name].weights).to_vector(), built.to_vector())
            continue
        assert "--seed" in words
        single = name[-1].isdigit()
        at = words.index("--velocity") + 1
        assert words[at : at + 2 - single] == ([name.rpartition("-")[2]] if single else ["0.1", "0.5"])
        assert ("--model-variant" in words) == (PRESETS[name].model_variant != ModelVariant())
        assert ("--over" in words) == name.startswith("robust")
        if "--begin" in words:
            begun = load_controller(words[words.index("--begin") + 1])
            assert isinstance(begun, Cruse1998)
            assert general(begun.weights).p1.any()


@pytest.mark.parametrize("weights", [LDVS.weights, Weights.of(dict.fromkeys(PLACES.values(), 1.0))])
def test_written_weights_are_read_to_the_same_bits(weights, tmp_path):
    path = tmp_path / "weights.toml"
    path.write_text(network_toml(Cruse1998(weights)))
    read = load_controller(str(path))
    assert isinstance(read, Cruse1998)
    assert np.array_equal(general(read.weights).to_vector(), general(weights).to_vector())


@pytest.mark.parametrize("order", ["printed", "sequential"])
@pytest.mark.parametrize("model_variant", MODEL_VARIANTS)
def test_written_rules_are_read_again(order, model_variant, tmp_path):
    path = tmp_path / "network.toml"
    path.write_text(network_toml(Cruse1998(LDVS.weights, order, model_variant=MODEL_VARIANTS[model_variant])))
    assert load_controller(str(path)) == Cruse1998(LDVS.weights, order, "network", MODEL_VARIANTS[model_variant])


def test_a_model_variant_without_a_name_is_not_written():
    with pytest.raises(InputError, match="strongest"):
        network_toml(Cruse1998(LDVS.weights, model_variant=ModelVariant(rear="strongest")))
