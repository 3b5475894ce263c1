"""Controllers by name: presets, rivals, files and objects of a user's own; and their settings."""

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any

import pytest

import hexmj
from hexmj.controllers import named
from hexmj.controllers.cruse1998 import network_toml
from hexmj.controllers.protocol import settings_of
from hexmj.controllers.registry import searched_on
from stepwise_ldvs import Own

LDVS = hexmj.LDVS

MINE = '''
from dataclasses import dataclass
import numpy as np
import hexmj
from hexmj.controllers import Controller, Step, stepwise

@dataclass(frozen=True)
class Still:
    """Stands."""
    name: str = "still"
    height: float = 0.0

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        return stepwise(lambda v: Step(starts, True), starts, velocity, stride, acceleration)

@dataclass(frozen=True)
class Needy(Still):
    legs: int = None

    def __post_init__(self):
        if self.legs is None:
            raise ValueError("legs is missing")

@dataclass(frozen=True)
class Named(Still):
    def __post_init__(self):
        {"still": 1}[self.name]

@dataclass(frozen=True)
class Switched(Still):
    def without(self, part):
        return {2: self, 3: None}[part]

@dataclass(frozen=True)
class Bare:
    name: str
    begin = Still.begin

@dataclass(frozen=True, init=False)
class Whole(Still):
    def __init__(self):
        super().__init__()

    @classmethod
    def begin(cls, *asked):
        return Still().begin(*asked)

@dataclass(frozen=True)
class Span:
    begin: float = 0.0

@dataclass(init=False)
class Table(dict):
    def begin(self, *asked):
        return Still().begin(*asked)

span = Span()
taller = Still("taller", 3.0)
Switched.usual = Still()
number = 6
'''


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A file of a user's own, which is also a module."""
    path = tmp_path / "mine_of_a_user.py"
    path.write_text(MINE)
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "broken.py").write_text("import nothing_of_this_name\n")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "helps_it.py").write_text("")
    (tmp_path / "deep" / "helped.py").write_text("import helps_it\n")
    (tmp_path / "deep" / "helping").mkdir()
    (tmp_path / "submodule.py").write_text("import deep.missing\n")
    (tmp_path / "long.py").write_text("raise ModuleNotFoundError(name='a' * 5000)\n")
    (tmp_path / "deep" / "helped_too.py").write_text("import helping.it\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield path
    sys.modules.pop("mine_of_a_user", None)


def test_controllers_by_name(mine, tmp_path, monkeypatch):
    assert hexmj.load_controller("ldvs") is LDVS
    (tmp_path / "set.toml").write_text(network_toml(hexmj.HWS))
    assert hexmj.load_controller("set.toml") == replace(hexmj.HWS, name="set")
    for where in (mine.name, str(mine), "mine_of_a_user"):
        assert settings_of(hexmj.load_controller(f"{where}:Still")) == {"name": "still", "height": 0.0}
        assert settings_of(hexmj.load_controller(f"{where}:taller")) == {"name": "taller", "height": 3.0}
    point = EntryPoint("robot", "mine_of_a_user:taller", named.ENTRY_POINTS)
    monkeypatch.setattr(named, "entry_points", lambda name="robot", **_: [point] if name == "robot" else [])
    assert hexmj.load_controller("robot").name == "taller"
    assert "robot" in named.known_names()
    parted = EntryPoint("still-without-3", "mine_of_a_user:Switched.usual", named.ENTRY_POINTS)
    monkeypatch.setattr(
        named, "entry_points", lambda name="", **_: [one for one in (point, parted) if one.name == name]
    )
    assert hexmj.load_controller("still-without-3").name == "still"
    alone, ours = (EntryPoint(one, "mine_of_a_user", named.ENTRY_POINTS) for one in ("alone", "ldvs-without-1"))
    points = point, parted, alone, ours
    monkeypatch.setattr(named, "entry_points", lambda name="", **_: [one for one in points if one.name == name])
    assert hexmj.load_controller("ldvs-without-1") == LDVS.without(1)
    with pytest.raises(hexmj.InputError, match=r"^entry point 'alone' = 'mine_of_a_user'; expected module:object$"):
        hexmj.load_controller("alone")
    twice = point, EntryPoint("robot", "mine_of_a_user:Still", named.ENTRY_POINTS)
    monkeypatch.setattr(named, "entry_points", lambda **_: twice)
    assert [*named.known_names()].count("robot") == 1
    with pytest.raises(hexmj.InputError, match=r"several packages; expected one of \S+:taller, \S+:Still$"):
        hexmj.load_controller("robot")
    monkeypatch.setattr(named, "entry_points", lambda name="robot", **_: [point] if name == "robot" else [])
    (tmp_path / "tall.toml").write_text('controller = "robot"\n[fields]\nheight = 4.0\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "tall", "height": 4.0}
    monkeypatch.setattr(
        named, "entry_points", lambda name="still-without-3", **_: [parted] if name == parted.name else []
    )
    (tmp_path / "tall.toml").write_text('controller = "still-without-3"\n[fields]\nname = "own"\n')
    assert hexmj.load_controller("tall.toml").name == "own"


def test_a_field_may_have_a_type_for_type_checkers_alone(mine, tmp_path):
    text = (
        mine.read_text()
        .replace("height: float", "height: Height")
        .replace("import numpy", "Height = float\nimport numpy")
    )
    mine.write_text(f"from __future__ import annotations\n{text}")
    (tmp_path / "tall.toml").write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = "4"\n')
    with pytest.raises(hexmj.InputError, match=r"height = '4'; expected a number"):
        hexmj.load_controller("tall.toml")
    mine.write_text(MINE)
    only = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from numpy.typing import NDArray\n"
    text = mine.read_text().replace("height: float = 0.0", "height: float = 0.0\n    table: NDArray | None = None")
    mine.write_text(f"from __future__ import annotations\n{only}{text}")
    (tmp_path / "tall.toml").write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "tall", "height": 4.0, "table": None}


def test_a_file_may_name_a_controller_and_its_fields(mine, tmp_path):
    path = tmp_path / "tall.toml"
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4.0\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "tall", "height": 4.0}, "another one than still"
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4\n')
    assert repr(settings_of(hexmj.load_controller("tall.toml"))["height"]) == "4.0", "the same setting"
    path.write_text('controller = "mine_of_a_user.py:Still"\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "still", "height": 0.0}
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4\nname = "mine"\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "mine", "height": 4.0}
    path.write_text('controller = "mine_of_a_user.py:Named"\n[fields]\nheight = 4\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "still", "height": 4.0}, "it takes no other name"
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = "4.0"\n')
    with pytest.raises(hexmj.InputError, match=r"\[fields\]: height = '4.0'; expected a number"):
        hexmj.load_controller("tall.toml")
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nwidth = 4.0\n')
    with pytest.raises(hexmj.InputError, match=r"\[fields\]: width; valid names of mine_of_a_user.py:Still: "):
        hexmj.load_controller("tall.toml")


def test_what_a_class_takes_beside_its_fields_may_stand_among_them(mine, tmp_path):
    raised = "\n    def __post_init__(self, scale):\n        assert self.height < 5, 'too tall'\n"
    mine.write_text(f"{MINE}\n@dataclass(frozen=True)\nclass Scaled(Still):\n    scale: InitVar[float] = 1.0\n{raised}")
    mine.write_text(mine.read_text().replace("import dataclass", "import InitVar, dataclass"))
    (tmp_path / "tall.toml").write_text('controller = "mine_of_a_user.py:Scaled"\n[fields]\nscale = 2.0\nheight = 6\n')
    with pytest.raises(hexmj.InputError, match=r"\[fields\]: too tall; expected fields of mine_of_a_user.py:Scaled"):
        hexmj.load_controller("tall.toml")


@pytest.mark.parametrize("name", ["evolved", "walknet-reacog-without-2"])
def test_a_file_may_name_a_rival_by_its_name(name, tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(f'controller = "{name}"\n[fields]\nname = "found"\n')
    usual: Any = hexmj.load_controller(name)
    assert hexmj.load_controller(str(path)) == replace(usual, name="found")


@pytest.mark.parametrize(
    ("told", "seeds"),
    [
        ("{ seeds = [4, 5] }", [4, 5]),
        ('{ seeds = [4, true, "x", 2020-01-01] }', [4]),
        ("{ starts = 40, seed = 0 }", []),
        ("{ seeds = 5 }", []),
        ('"x"', []),
        ("[]", []),
    ],
)
def test_a_file_tells_the_seeds_of_the_searches_that_found_it(told, seeds, tmp_path):
    for name in ("found.toml", "found"):
        path = tmp_path / name
        path.write_text(f"searched = {told}\n{network_toml(LDVS)}")
        found = hexmj.load_controller(str(path))
        assert found == replace(LDVS, name="found")
        for one in (str(path), f"{path}-without-3"):
            assert searched_on(one, found) == ({str(path): seeds} if seeds else {})


def test_our_own_sets_are_known_by_any_name(tmp_path):
    (tmp_path / "mine.toml").write_text(f"searched = {{ seeds = [7] }}\n{network_toml(hexmj.PRESETS['own-0.4'])}")
    (tmp_path / "same.toml").write_text('controller = "evolved"\n')
    (tmp_path / "other.toml").write_text('controller = "evolved"\nfields = { tau = 0.0 }\n')
    mine = str(tmp_path / "mine.toml")
    for name, seeds in (
        (mine, {"own-0.4": [0], mine: [7]}),
        ("own-0.4-without-3", {"own-0.4": [0]}),
        ("robust-0.3", {"robust-0.3": [0, 5]}),
        ("hexmj:LDVS", {}),
        ("uncoordinated", {}),
        ("walknet", {}),
        *((one, {"evolved": [0]}) for one in ("evolved", "hexmj.controllers.baselines.evolved:EVOLVED")),
        (str(tmp_path / "same.toml"), {"evolved": [0]}),
        (str(tmp_path / "other.toml"), {}),
    ):
        assert searched_on(name, hexmj.load_controller(name)) == seeds


@pytest.mark.parametrize("name", ["ring.toml", "a:ring.toml"])
def test_toml_that_names_itself_is_refused(tmp_path, name):
    path = tmp_path / name
    path.write_text(f"controller = '{path}'\n[fields]\n")
    with pytest.raises(
        hexmj.InputError, match=r"expected module:object, file.py:object, a preset, a rival or an entry point"
    ):
        hexmj.load_controller(str(path))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("lvds", "controller 'lvds' is neither one of hws, ldvs, uncoordinated, .* nor a TOML file"),
        ("", "controller '' is neither one of hws"),
        ("x" * 5000, "is neither one of"),
        ("nowhere.toml", "'nowhere.toml' is no file; expected the path of one"),
        ("nowhere.py:Still", "nowhere.py is no file; expected the path of one from the current folder"),
        ("~/nowhere.py:Still", "~ is expanded by shells"),
        ("deep/helped.py:Still", "No module named 'helps_it'; it lies beside it: expected to run in that folder"),
        ("deep/helped_too.py:Still", "No module named 'helping'; it lies beside it"),
        ("long.py:Still", r"cannot be loaded: ModuleNotFoundError: $"),
        ("submodule.py:Still", r"No module named 'deep.missing'$"),
        ("notes.txt:Still", "notes.txt is neither a module nor a file that ends in .py$"),
        ("./mine_of_a_user:Still", "./mine_of_a_user is neither a module nor a file that ends in .py$"),
        ("nothing_of_this_name:Still", "nothing_of_this_name cannot be imported: ModuleNotFoundError"),
        ("broken.py:Still", "broken.py cannot be loaded: ModuleNotFoundError: No module named 'nothing_of_this_name'$"),
        ("mine_of_a_user.py:Stil", "no Stil there; controllers there: Still, Needy, Named, Switched, Whole, taller$"),
        ("mine_of_a_user.py:Switched-without-1", "Switched-without-1' cannot be made: KeyError: 1; expected a"),
        ("mine_of_a_user.py:Switched-without-3", "Switched-without-3: controller = None; expected a controller"),
        ("mine_of_a_user.py:number", "controller = 6; expected a controller, a frozen dataclass"),
        ("mine_of_a_user.py:np", "expected a controller, a frozen dataclass"),
        ("mine_of_a_user.py:Needy", "Needy' cannot be made: ValueError: legs is missing; expected a class"),
    ],
)
def test_wrong_names_get_one_sentence(mine, name, words):
    with pytest.raises(hexmj.InputError, match=words) as wrong:
        hexmj.load_controller(name)
    assert "\n" not in str(wrong.value)


def test_settings_are_plain_data():
    settings = settings_of(hexmj.SensoryFeedback(hexmj.PRESETS["own-0.1"]))
    assert set(settings) == {"controller"}
    assert isinstance(settings["controller"]["weights"]["p1"][0], list)
    with pytest.raises(hexmj.InputError, match="expected a controller"):
        settings_of(Own)  # pyright: ignore[reportArgumentType]
