"""Controllers by name: presets, baselines, files, objects and entry points; fields from TOML; and their settings."""

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers import registry
from hexmj.controllers.cruse1998 import network_toml
from hexmj.controllers.cruse1998.weights import general
from hexmj.controllers.protocol import settings_of
from hexmj.controllers.registry import searched_on
from stepwise_ldvs import Own

LDVS = hexmj.LDVS

MINE = """
from dataclasses import dataclass
from typing import Literal
import hexmj
from hexmj.controllers import Step, stepwise

@dataclass(frozen=True)
class Still:
    name: str = "still"
    height: float = 0.0
    count: int = 3
    fast: bool = False
    gait: Literal["tripod", "wave"] = "tripod"
    lags: tuple[float, ...] = (0.0,)
    limit: float | None = None
    weights: hexmj.Symmetric = hexmj.Symmetric(p2=1.0)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        return stepwise(lambda v: Step(starts, True), starts, velocity, stride, acceleration)

    def without(self, part):
        return Still(f"{self.name}-without-{part}")

@dataclass(frozen=True)
class Needy:
    name: str
    begin = Still.begin

taller = Still("taller", 3.0)
number = 6
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Provide a user's file, which is also a module, in the current directory."""
    path = tmp_path / "mine_of_a_user.py"
    path.write_text(MINE)
    (tmp_path / "broken.py").write_text("import nothing_of_this_name\n")
    (tmp_path / "torn.py").write_text("def half(\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield path
    sys.modules.pop("mine_of_a_user", None)


def test_controllers_by_name(mine, tmp_path, monkeypatch):
    assert hexmj.load_controller("ldvs") is LDVS
    assert hexmj.load_controller("ldvs-without-3") == LDVS.without(3)
    assert hexmj.load_controller("ldvs-with-2-without-1") == LDVS.having(2).without(1)
    (tmp_path / "weights.toml").write_text(network_toml(hexmj.HWS))
    assert hexmj.load_controller("weights.toml") == replace(hexmj.HWS, name="weights")
    for where in (mine.name, str(mine), "mine_of_a_user"):
        assert hexmj.load_controller(f"{where}:Still").name == "still"
        assert settings_of(hexmj.load_controller(f"{where}:taller"))["height"] == 3.0
    point = EntryPoint("robot", "mine_of_a_user:taller", registry.ENTRY_POINTS)
    monkeypatch.setattr(registry, "entry_points", lambda name="robot", **_: [point] if name == "robot" else [])
    assert hexmj.load_controller("robot").name == "taller"
    assert hexmj.load_controller("robot-without-2").name == "taller-without-2"
    assert "robot" in registry.known_names()


@pytest.mark.parametrize("part", ["without-1", "without-3", "without-4", "with-2"])
@pytest.mark.parametrize("name", ["ldvs", "own-0.3"])
def test_a_mechanism_that_is_switched_off_has_no_weights_and_the_others_keep_theirs(name, part):
    whole, changed = (general(hexmj.load_controller(one).weights) for one in (name, f"{name}-{part}"))  # pyright: ignore
    for kind in ("p1", "p2", "p31", "p32", "p33", "p34", "p4"):
        now, before = getattr(changed, kind), getattr(whole, kind)
        if kind[1] != part[-1]:
            assert np.array_equal(now, before)
        else:
            assert now.any() == part.startswith("with-")


def test_without_all_mechanisms_the_network_is_uncoordinated():
    nothing, starts = LDVS.without(1).without(3).without(4), hexmj.draw_starts(50, 0)
    one, other = (hexmj.first_loss(starts, controller, 0.3, 100.0) for controller in (nothing, hexmj.UNCOORDINATED))
    assert np.array_equal(one, other)


def from_fields(text: str) -> dict[str, Any]:
    """Return the settings of a controller from a table of fields."""
    with open("tall.toml", "w") as file:
        file.write(f'controller = "mine_of_a_user.py:Still"\n[fields]\n{text}\n')
    return settings_of(hexmj.load_controller("tall.toml"))


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("name", "", "still"),
        ("name", "count = 4", "tall"),
        ("name", 'name = "mine"', "mine"),
        ("height", "height = 4", 4.0),
        ("fast", "fast = true", True),
        ("gait", 'gait = "wave"', "wave"),
        ("lags", "lags = [0.0, 0.5]", [0.0, 0.5]),
        ("limit", "limit = 1.0", 1.0),
    ],
)
def test_a_file_may_give_the_fields_of_a_controller(mine, name, text, value):
    found = from_fields(text)[name]
    assert repr(found) == repr(value)


def test_a_table_changes_some_fields_of_a_nested_dataclass(mine):
    weights = from_fields("weights = { p1_i = 3 }")["weights"]
    assert (weights["p1_i"], weights["p2"]) == (3.0, 1.0)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("height", 'height = "4.0"'),
        ("fast", "fast = 1"),
        ("int", "lags = 3"),
        ("width", "width = 4.0"),
    ],
)
def test_invalid_fields_are_refused(mine, name, text):
    with pytest.raises(hexmj.InputError, match=name):
        from_fields(text)


@pytest.mark.parametrize("name", ["evolved", "walknet-reacog-without-2"])
def test_a_file_may_name_a_baseline(name, tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(f'controller = "{name}"\n[fields]\nname = "found"\n')
    usual: Any = hexmj.load_controller(name)
    assert hexmj.load_controller(str(path)) == replace(usual, name="found")


def test_a_file_holds_the_seeds_of_the_searches_that_found_it(tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(f"searched = {{ seeds = [4, 5] }}\n{network_toml(LDVS)}")
    found = hexmj.load_controller(str(path))
    assert found == replace(LDVS, name="found")
    for name in (str(path), f"{path}-without-3"):
        assert searched_on(name) == {str(path): [4, 5]}


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("own-0.4-without-3", {"own-0.4": [0]}),
        ("robust-0.3", {"robust-0.3": [0, 5]}),
        ("hexmj:LDVS", {}),
        ("evolved", {"evolved": [0]}),
    ],
)
def test_our_own_sets_name_the_seeds_of_their_searches(name, found):
    assert searched_on(name) == found


@pytest.mark.parametrize(
    "name",
    [
        "lvds",
        "nowhere.toml",
        "nowhere.py:Still",
        "nothing_of_this_name:Still",
        "broken.py:Still",
        "torn.py:Still",
        "mine_of_a_user.py",
        "mine_of_a_user.py:Stil",
        "mine_of_a_user.py:number",
        "mine_of_a_user.py:Needy",
        "cpg-wave-without-1",
        "ldvs-without-2",
        "walknet-with-2",
    ],
)
def test_wrong_names_are_refused(mine, name):
    with pytest.raises(hexmj.InputError, match=name.partition("-without")[0].partition(":")[0]):
        hexmj.load_controller(name)


def test_settings_are_plain_data():
    settings = settings_of(hexmj.SensoryFeedback(hexmj.PRESETS["own-0.1"]))
    assert set(settings) == {"controller"}
    assert isinstance(settings["controller"]["weights"]["p1"][0], list)
    with pytest.raises(hexmj.InputError, match="controller"):
        settings_of(Own)  # pyright: ignore[reportArgumentType]
