"""Fields of controllers as a TOML file tells them."""

from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import hexmj
from hexmj.controllers.toml_fields import with_fields
from hexmj.plain import plain

KINDS = """
from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
import numpy as np
from numpy.typing import NDArray
from hexmj import timing
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, Optional, Sequence

if TYPE_CHECKING:
    from nowhere import Thing

class Mode(Enum):
    SLOW = "slow"

@dataclass(frozen=True)
class Inner:
    g: float = 1.0

@dataclass(frozen=True)
class Named:
    g: str = ""

class Deep(NamedTuple):
    a: float = 1.0
    b: float = 2.0

@dataclass(frozen=True)
class Part:
    deep: Deep = Deep()
    c: int = 3

@dataclass(frozen=True)
class Heir(Inner):
    h: float = 6.0

    def _replace(self): ...

@dataclass(frozen=True)
class Fast:
    g: float = 3.0

@dataclass(frozen=True)
class Odd:
    class Own(Enum):
        HERE = 1

    name: str = "odd"
    mode: Mode = Mode.SLOW
    timing: timing.Stride = timing.Stride()
    place: str = "here"
    inner: Inner | dict = Inner()
    made: Inner = Inner()
    legs: tuple[float, ...] = (1.0,)
    feet: Literal["locked", "free"] = "locked"
    most: float | None = None
    other: Optional[Mode] = None
    either: int | str = 1
    thing: Thing | None = None
    plain: Inner = Inner()
    mixed: tuple[bool, str] = (True, "a")
    none: tuple[()] = ()
    modes: tuple[Mode, ...] = ()
    inners: tuple[Inner, ...] = ()
    some: Sequence = ()
    bare: tuple = ()
    whole: np.ndarray = field(default_factory=lambda: np.ones(1, int))
    gains: np.ndarray = field(default_factory=lambda: np.ones(1))
    counts: NDArray[np.int64] | None = None
    phases: NDArray[np.floating] | None = None
    levels: NDArray[np.uint8] | None = None
    halves: NDArray[np.float32] | None = None
    none_set: NDArray[np.bool_] | None = None
    level: Literal["a", 1] = 1
    fixed: ClassVar[int] = 3
    own: Own = Own.HERE
    which: Named | Inner = Inner()
    usual: Inner | Part | Fast = Fast()
    part: Part = Part(deep=Deep(b=5.0))
    heir: Inner = Heir(g=2.0, h=7.0)
    other_kind: Fast | Part = Fast()
    file: Path | None = None
    files: tuple[Path, ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "place", Path(self.place))
        if isinstance(self.made, dict) and "g" in self.made:
            object.__setattr__(self, "made", Inner(**self.made))

    def begin(self, starts, velocity, stride, acceleration=None, threads=None): ...
"""


@pytest.mark.parametrize(
    ("rest", "sentence"),
    [
        ('[fields]\nmode = "Slow"', "mode = 'Slow'; valid names: SLOW"),
        ("[fields]\nmade = {h = 0.5}", r"made = \{'h': 0.5\}; expected an Inner"),
        ('[fields]\nlegs = ["a"]', "legs = .*; expected some values, each a number"),
        ('[fields]\nfeet = "Locked"', "feet = 'Locked'; valid names: locked, free"),
        ("[fields]\nmost = false", "most = False; expected a number or None"),
        ('[fields]\nother = "Slow"', "other = 'Slow'; expected one of SLOW or None"),
        ('[fields]\nmade = {g = "x"}', "g = 'x'; expected a number"),
        ("[fields]\neither = 1.5", "either = 1.5; expected a whole number or a text"),
        ('[fields]\nmixed = ["b", true]', "mixed = .*; expected 2 values: True or False, a text"),
        ("[fields]\nlevel = true", "level = True; valid names: a, 1"),
        ('[fields]\nbare = "a"', "bare = 'a'; expected a tuple"),
        ('[fields]\ngains = "a"', "gains = 'a'; expected an array"),
        ("[fields]\ngains = [[1], [2, 3]]", "gains = .*; expected an array"),
        ('[fields]\ngains = [1, "a"]', "gains = .*; expected an array"),
        ("[fields]\ngains = [true, 2]", "gains = .*; expected an array"),
        ("[fields]\ncounts = [1.5]", "counts = .*; expected an array"),
        ("[fields]\nlevels = [300]", "levels = .*; expected an array"),
        ("[fields]\nhalves = [1e300]", "halves = .*; expected an array"),
        ("[fields]\nhalves = [1e-300]", "halves = .*; expected an array"),
        ("[fields]\nfile = 3", "file = 3; expected a Path or None"),
        ('[fields]\npart = {deep = {a = "x"}}', "a = 'x'; expected a number"),
        ("[field]\nname = 'x'", "holds controller, field; expected controller and a table"),
        ("name = 'x'", "holds controller, name; expected controller and a table"),
        (
            '[fields]\nmade = {g = 0.5}\ninner = {g = 2}\nthing = 5\nnone = []\nfeet = "free"\neither = "x"\nmost = 2',
            None,
        ),
    ],
)
def test_what_a_file_tells_of_fields_is_of_their_types(rest, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("odd.py").write_text(KINDS)
    Path("odd.toml").write_text(f"controller = 'odd.py:Odd'\n{rest}\n")
    with pytest.raises(hexmj.InputError, match=sentence) if sentence else nullcontext():
        hexmj.load_controller("odd.toml")


def test_arrays_of_a_file_are_as_they_are_annotated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("odd.py").write_text(KINDS)
    told = "levels = [1, 255]\nhalves = [0.1, 2]\nnone_set = []\ncounts = []\nwhole = []"
    Path("odd.toml").write_text(f"controller = 'odd.py:Odd'\n[fields]\n{told}\n")
    odd: Any = hexmj.load_controller("odd.toml")
    assert [str(one.dtype) for one in (odd.levels, odd.halves, odd.none_set, odd.counts, odd.whole)] == [
        *("uint8", "float32", "bool", "int64", "int64")
    ]
    assert odd.levels.tolist() == [1, 255] and odd.none_set.shape == odd.counts.shape == (0,)


@dataclass(frozen=True)
class Named:
    words: np.ndarray = field(default_factory=lambda: np.array(["a"]))


def test_texts_of_an_array_may_be_none():
    assert with_fields(Named(), {"words": []}, "named").words.shape == (0,)


def test_what_a_file_tells_is_as_the_class_has_it(tmp_path, monkeypatch):
    """Rows are tuples, which may be added to and hashed, tables records, texts members of enumerations."""
    monkeypatch.chdir(tmp_path)
    Path("odd.py").write_text(KINDS)
    told = {"modes": ["SLOW"], "inners": [{"g": 2}], "some": [1, 2], "own": "HERE", "which": {"g": 2.0}}
    told |= {"bare": [1, "a"], "gains": [1, 2], "whole": [0.5], "level": 1}
    told |= {"place": "there", "legs": [1, 2], "mode": "SLOW", "other": "slow", "plain": {"g": 2}, "inner": {"g": 2}}
    told |= {"heir": {"g": 3}, "other_kind": {"c": 4}, "counts": [3], "phases": [1, 2]}
    told |= {"usual": {"g": 4}, "part": {"c": 4, "deep": {"a": 7}}, "file": "gains.toml", "files": ["a", "b"]}
    Path("odd.toml").write_text(tomli_w.dumps({"controller": "odd.py:Odd", "fields": told}))
    odd: Any = hexmj.load_controller("odd.toml")
    assert repr(odd.legs) == "(1.0, 2.0)"
    assert repr([odd.bare, odd.gains, odd.whole, odd.level]) == "[(1, 'a'), array([1., 2.]), array([0.5]), 1]"
    assert [str(one.dtype) for one in (odd.counts, odd.phases)] == ["int64", "float64"]
    assert repr([odd.modes, odd.inners, odd.some]) == "[(<Mode.SLOW: 'slow'>,), (Inner(g=2.0),), [1, 2]]"
    assert repr([odd.own, odd.which]) == "[<Own.HERE: 1>, Inner(g=2.0)]"
    assert repr([odd.mode, odd.other]) == "[<Mode.SLOW: 'slow'>, <Mode.SLOW: 'slow'>]"
    assert repr([odd.plain, odd.inner]) == "[Inner(g=2.0), {'g': 2}]"
    assert repr(odd.part) == "Part(deep=Deep(a=7.0, b=5.0), c=4)", "what is not told is as usual"
    assert repr(odd.usual) == "Fast(g=4.0)", "of the kind it is, where others fit too"
    assert repr(odd.heir) == "Heir(g=3.0, h=7.0)"
    assert repr(odd.other_kind) == "Part(deep=Deep(a=1.0, b=2.0), c=4)"
    assert (odd.file, odd.files) == (Path("gains.toml"), (Path("a"), Path("b")))
    assert plain(odd)["mode"]["member"] == "SLOW"


def test_a_file_tells_fields_of_the_controller_within_another(tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(f"controller = '{tmp_path / 'mine_reads.py'}:USUAL'\n[fields.controller]\norder = 'undelayed'\n")
    (tmp_path / "mine_reads.py").write_text("import hexmj\nUSUAL = hexmj.ReadsLegs(hexmj.LDVS)\n")
    found: Any = hexmj.load_controller(str(path))
    assert found.controller == replace(hexmj.LDVS, order="undelayed")
