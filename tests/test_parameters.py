"""Weights, symmetric forms, presets and parameter files."""

import re
import runpy
import shlex
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import HWS, LDVS, PRESETS, MODEL_VARIANTS, Cruse1998, ModelVariant, Symmetric, Weights
from hexmj.controllers.cruse1998.presets import OWN, network_toml
from hexmj.controllers.cruse1998.weights import HWS_WEIGHTS, LDVS_WEIGHTS, NEIGHBOURS, NO_WEIGHTS, general
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
    """58 for the LDVS form, 48 for the HWS form (Section 2): 10, 4, 40 and 4 by mechanism."""
    pairs = {kind: sum(map(len, n)) for kind, n in NEIGHBOURS.items()}
    assert pairs["p1"] == 10
    assert pairs["p2"] == pairs["p4"] == 4
    assert sum(pairs[kind] for kind in ("p31", "p32", "p33", "p34")) == 40
    assert sum(pairs.values()) == 58
    assert len(general(LDVS.weights).to_vector()) == 58
    assert len(general(HWS.weights).to_vector(48)) == 48


@pytest.mark.parametrize("weights", [HWS_WEIGHTS, LDVS_WEIGHTS, NO_WEIGHTS])
def test_vectors_of_symmetric_sets_go_back_and_forth(weights):
    assert Symmetric.from_vector(weights.to_vector()) == weights


@pytest.mark.parametrize("controller", PRESETS.values(), ids=PRESETS)
def test_vectors_go_back_and_forth(controller):
    weights = general(controller.weights)
    again = Weights.from_vector(weights.to_vector())
    assert all(np.array_equal(getattr(weights, kind), getattr(again, kind)) for kind in NEIGHBOURS)


def test_short_forms_leave_out_the_velocity_dependence():
    assert Symmetric.from_vector(HWS_WEIGHTS.to_vector(9)) == HWS_WEIGHTS
    assert np.array_equal(
        Weights.from_vector(general(HWS_WEIGHTS).to_vector(48)).to_vector(), general(HWS_WEIGHTS).to_vector()
    )
    weights: Any
    for weights, short in ((LDVS.weights, 9), (general(LDVS.weights), 48)):
        with pytest.raises(InputError, match=r"p34.* lack it"):
            weights.to_vector(short)
    assert general(LDVS.weights).p34.any()


def test_appendix_a():
    p = general(LDVS.weights)
    assert p.p1[0, 1] == p.p1[4, 5] == LDVS_WEIGHTS.p1_i
    assert p.p1[0, 3] == p.p1[5, 2] == LDVS_WEIGHTS.p1_c
    assert p.p31[1, 0] == p.p31[5, 4] == LDVS_WEIGHTS.p31_i
    assert p.p32[3, 0] == p.p33[3, 0] == LDVS_WEIGHTS.p32_c
    assert p.p34[2, 1] == LDVS_WEIGHTS.p34_i
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
    ("text", "words"),
    [
        ("[symmetric]\np5_i = 1.0", "unknown key 'p5_i'; valid keys: 'p1_i'"),
        ("[symmetric]\np1_i = 'ten'", "p1_i = 'ten'; expected a number"),
        ("[symmetric]\np1_i = true", "expected a number"),
        ("[symmetric]\np1_i = nan", "finite"),
        ("[symmetric]\np2 = 0.5", r"model\.toml \[symmetric\]: p2 = 0\.5; .* expected 0 or 1"),
        ("[symmetric", "cannot be read as TOML"),
        ("[other]\na = 1", "expected one table, .* and before it order and reading"),
        ("", "holds nothing"),
        ("[weights.p9]\n'1,2' = 1.0", r"unknown table \[weights.p9\]; valid names: p1"),
        ("[weights.p1]\n'1,6' = 1.0", "unknown key '1,6'; valid keys: '1,2'"),
        ("[weights.p4]\n'2,1' = 2", r"model\.toml: .*binary"),
        ("weights = 3", "expected one table"),
        ("[weights]\np1 = 3", "expected a table with the keys"),
    ],
)
def test_files_that_make_no_sense(tmp_path, text, words):
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        load_controller(str(path))


def test_names_that_do_not_exist():
    with pytest.raises(InputError, match=r"neither one of hws, ldvs, uncoordinated, own-0.1, .* nor a TOML file"):
        load_controller("lvds")


def test_names_of_controllers(tmp_path):
    """As in tables and titles: that of a preset, and of a file without its folder and ending."""
    path = tmp_path / "found-0.1.toml"
    path.write_text(network_toml(HWS))
    names = ("hws", "own-0.1", str(path))
    assert [load_controller(name).name for name in names] == ["hws", "own-0.1", "found-0.1"]


def test_weights_off_the_neighbour_sets():
    p1 = np.zeros((6, 6))
    p1[0, 5] = 1.0
    with pytest.raises(InputError, match="p1 of leg L1 from leg R3"):
        Weights(p1, *(np.zeros((6, 6)) for _ in range(6)))
    with pytest.raises(InputError, match=r"p1 has shape \(5, 6\); expected \(6, 6\)"):
        Weights(np.zeros((5, 6)), *(np.zeros((6, 6)) for _ in range(6)))
    with pytest.raises(InputError, match="p31 holds a number that is not finite"):
        Weights(*(np.full((6, 6), np.nan if kind == 2 else 0.0) for kind in range(7)))
    with pytest.raises(InputError, match="p1_i = inf; expected a finite number"):
        Symmetric(p1_i=np.inf)
    with pytest.raises(InputError, match="expected 58"):
        Weights.from_vector([0.0] * 10)
    with pytest.raises(InputError, match="expected 10"):
        Symmetric.from_vector([0.0] * 8)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Geometry(lateral=(18.0, 0.0, 15.0)), "expected finite origins and lateral distances above 0 mm"),
        (lambda: Geometry(origins=(28.0, float("inf"), -20.0)), "expected finite origins"),
        (lambda: Acceleration(start=1.0), r"velocity at the start = 1.0; expected 0 <= V_r\(0\) < 1"),
        (lambda: Acceleration(rate=0.0), "acceleration = 0.0; expected a finite number above 0"),
        (lambda: Conditions(gravity=1.0), "condition 'gravity'; valid names: "),
        (
            lambda: draw_starts(MOST_DRAWN + 1, 0),
            f"starts = {MOST_DRAWN + 1}; expected at most {MOST_DRAWN} in one array",
        ),
    ],
)
def test_settings_that_make_no_sense(made, words):
    with pytest.raises(InputError, match=words):
        made()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"dt": 0.0}, "dt = 0.0; expected a time step of at least 1e-05"),
        ({"dt": 1e-6}, "dt = 1e-06; expected a time step of at least 1e-05"),
        ({"aep0": -11.0}, "expected pep_min <= pep0 < aep0"),
        ({"pep_min": 0.0}, "expected pep_min <= pep0 < aep0"),
        ({"pep0": float("nan")}, "expected aep0, pep0 and pep_min between"),
        ({"geometry": "fig1"}, "geometry = 'fig1'; expected a Geometry"),
    ],
)
def test_strides_that_make_no_sense(change, words):
    with pytest.raises(InputError, match=words):
        Stride(**change)


def test_networks_that_make_no_sense():
    with pytest.raises(InputError, match="order = 'random'; valid names: printed, undelayed, sequential"):
        Cruse1998(HWS.weights, order="random")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="weights = 'hws'; expected a Symmetric or a Weights"):
        Cruse1998("hws")  # pyright: ignore[reportArgumentType]


def test_weights_copy_their_input():
    matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
    weights = Weights(**matrices)
    matrices["p1"][0, 1] = 3.0
    assert not weights.p1.any()


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
    """On fresh starts; over the observation time `start` LDVS is better than `own` at V = 0.1 (docs/paper.md)."""
    for v in velocities:
        own, papers = (
            [flss(PRESETS[name.format(v)], [v], seed=7, observation_time=observation_time).flss.item() for name in group]
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
        at = words.index("--velocity" if single else "--velocities") + 1
        assert words[at : at + 2 - single] == ([name.rpartition("-")[2]] if single else ["0.1", "0.5"])
        assert ("--reading" in words) == (PRESETS[name].model_variant != ModelVariant())
        assert ("--over" in words) == name.startswith("robust")
        if "--begin" in words:
            begun = load_controller(words[words.index("--begin") + 1])
            assert isinstance(begun, Cruse1998)
            assert general(begun.weights).p1.any()


@pytest.mark.parametrize("weights", [LDVS.weights, Weights.from_vector(np.random.default_rng(1).integers(0, 2, 58))])
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


@pytest.mark.parametrize("wrong", ["'wrong'", "['lasting']", "1"])
@pytest.mark.parametrize(("rule", "valid"), [("order", "sequential"), ("model_variant", "lasting")])
def test_unknown_rules_are_refused(rule, valid, wrong, tmp_path):
    path = tmp_path / "network.toml"
    path.write_text(f"{rule} = {wrong}\n{network_toml(LDVS)}")
    with pytest.raises(InputError, match=re.escape(f"{rule} = {wrong}") + f".*{valid}"):
        load_controller(str(path))


def test_a_reading_without_a_name_is_not_written():
    with pytest.raises(InputError, match="has no name; named ones: printed, lasting"):
        network_toml(Cruse1998(LDVS.weights, model_variant=ModelVariant(rear="strongest")))
