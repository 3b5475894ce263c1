"""Settings of a cell become plain data, files among them what they hold; what cannot is refused."""

import json
import shutil
import sys
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import InitVar, dataclass, make_dataclass
from enum import Enum, IntFlag, StrEnum
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

import hexmj
from hexmj import field_docs
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.sweep import Cell
from hexmj.sweeps.plain_settings import classes, named_files, plain
from hexmj.timing import Stride
from hexmj.user_code.loaded import importable
from small_cells import Wave, odd_bits


def test_settings_become_plain_json() -> None:
    settings = {
        "wave": Wave(2.0, np.array([[1.0, -0.0]])),
        "pair": (1, None, True, "text"),
        "number": np.float64(0.1),
        "inner": {"folder": Path("/nowhere"), "counts": np.arange(2)},
    }
    assert plain(settings) == {
        "wave": {"class": "small_cells.Wave", "slope": 2.0, "values": [[1.0, -0.0]]},
        "pair": [1, None, True, "text"],
        "number": 0.1,
        "inner": {"folder": "/nowhere", "counts": [0, 1]},
    }
    assert json.loads(json.dumps(plain(settings))) == plain(settings)


class Rule(NamedTuple):
    """With a method, as users write rules."""

    far: float = 10.0

    def pep(self, velocity: float) -> float:
        return -self.far - 15.0 * velocity


class Other(Rule):
    pass


class Pair(tuple[int, ...]):
    pass


def test_a_named_tuple_is_its_class_too() -> None:
    told = [plain({"rule": rule})["rule"] for rule in (Rule(), Other())]
    assert told == [{"class": f"test_plain_settings.{name}", "far": 10.0} for name in ("Rule", "Other")]
    assert list(classes([Rule(), {"in": (Other(), 1)}])) == [Rule, Other]


class Way(Enum):
    FAST = "fast"


class Of(Enum):
    OBJECT = object()


class Flags(IntFlag):
    ONE = 1


class Tone(StrEnum):
    LOW = "low"


def test_a_member_of_an_enumeration_is_its_class_name_and_value() -> None:
    told = [
        {"class": f"test_plain_settings.{name}", "member": member, "value": value}
        for name, member, value in (("Way", "FAST", "fast"), ("Tone", "LOW", "low"))
    ]
    assert plain([Way.FAST, Tone.LOW]) == told
    assert plain(Flags(4)) != plain(Flags(8))
    assert plain(Of.OBJECT) == {"class": "test_plain_settings.Of", "member": "OBJECT"}
    other: Any = Enum("Way", {"FAST": "slow"})
    assert plain(other.FAST) == told[0] | {"value": "slow"}
    assert list(classes({"ways": [Way.FAST], "tone": Tone.LOW})) == [Way, Tone]


@pytest.mark.parametrize(
    "value",
    [
        *({1, 2}, object(), np.float32(1.0), np.array([object()]), {1: 2}, len, Wave, 1j, Path()),
        *(Pair((1, 2)), OrderedDict(a=1), MappingProxyType({"a": 1}), np.ma.masked_array([1.0])),
    ],
)
def test_what_is_no_setting_is_refused_in_one_sentence(value: object) -> None:
    with pytest.raises(InputError, match="is no setting; expected") as raised:
        plain({"inner": (value,)})
    assert "\n" not in str(raised.value)


@dataclass(frozen=True)
class Hidden:
    """With a setting that is no field, and something computed once."""

    pull: InitVar[float] = 1.0
    name: str = "hidden"

    def __post_init__(self, pull: float) -> None:
        assert self.doubled == 2
        object.__setattr__(self, "kept", pull)

    @cached_property
    def doubled(self) -> int:
        return 2


class Slotted:
    __slots__ = ("kept",)


@dataclass(frozen=True, slots=True)
class HiddenInASlot(Slotted):
    """The same in a slot."""

    pull: InitVar[float] = 1.0
    name: str = "hidden"

    def __post_init__(self, pull: float) -> None:
        object.__setattr__(self, "kept", pull)


def made(gain: float) -> Any:
    """A controller of a class that nobody finds by its name."""

    def begin(self: Any, *given: Any, **how: Any) -> Any:
        return gain

    return make_dataclass(
        "Made", [("name", str, "made")], namespace={"begin": begin, "__module__": __name__}, frozen=True
    )()


def test_a_class_that_its_module_does_not_have_under_its_name_is_refused() -> None:
    with pytest.raises(InputError, match="Made is not what its module has under that name; expected one of a module"):
        plain(made(1.0))


def test_a_setting_that_no_field_tells_is_refused() -> None:
    with pytest.raises(InputError, match=r"HiddenInASlot keeps 'kept' beside its fields; expected all settings as"):
        plain(HiddenInASlot())
    with pytest.raises(InputError, match=r"Hidden keeps 'kept' beside its fields; expected all settings as fields"):
        plain(Hidden())


def test_a_whole_number_and_the_same_float_are_one_setting() -> None:
    for one, other in ((Conditions(vp=80, load=0), Conditions(load=-0.0)), (Stride(aep0=10), Stride())):
        assert json.dumps(plain(one)) == json.dumps(plain(other))


def test_naming_a_cell_reads_no_docstring_nor_does_reading_one_rename_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Docstrings of public classes parse sources, which Python 3.11 does not bear in several threads at once."""
    parsed, asked = field_docs.parsed, list[bytes]()
    monkeypatch.setattr(field_docs, "parsed", lambda source: asked.append(source) or parsed(source))
    field_docs.told.cache_clear()
    cell = Cell("a", odd_bits, {"seed": 0, "size": hexmj.Conditions()})
    with ThreadPoolExecutor(8) as pool:
        names = {one.result() for one in [pool.submit(cell.record) for _ in range(16)]}
    assert not asked
    assert "vp: " in (hexmj.Conditions.__doc__ or "")
    assert asked
    assert names == {cell.record()}


def test_what_code_can_tell_apart_is_no_one_cell() -> None:
    for one, other in (
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        ({"stride": 1, "order": 2}, {"stride": 1, "order": 3}),
        ((1.0, 2.0), np.array([1.0, 2.0])),
        ((0, 1), [0, 1]),
        ({"list": (0, 1)}, [0, 1]),
        ("tripod", Path("tripod")),
        (np.zeros(0, dtype=np.int64), np.zeros(0)),
        (np.zeros((0, 3)), np.zeros((0, 6))),
    ):
        assert plain(one, exact=True) != plain(other, exact=True)
        assert Cell("a", odd_bits, {"seed": one}).record() != Cell("a", odd_bits, {"seed": other}).record()


def test_a_file_among_the_settings_is_its_content_and_where_it_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for kind in (Path, str):
        for folder in ("here", "there"):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / "body.xml").write_text("<mujoco/>")
        here, there = (plain(kind(tmp_path / folder / "body.xml")) for folder in ("here", "there"))
        assert here.partition("@")[2] == there.partition("@")[2] != ""
        assert here != there
        told = set[tuple[str, str]]()
        for folder in (tmp_path, shutil.copytree(tmp_path, tmp_path.with_name(f"{tmp_path.name}-{kind.__name__}"))):
            monkeypatch.chdir(folder)
            told.add((plain(kind("here/body.xml")), plain(folder / "here" / "body.xml")))
        assert len(told) == 1
        (tmp_path / "here" / "body.xml").write_text("<mujoco> </mujoco>")
        assert plain(kind(tmp_path / "here" / "body.xml")) != here
    assert plain(text := str(tmp_path)) == text
    assert plain("0.5" * 2000) == "0.5" * 2000
    assert plain("a.b\0") == "a.b\0" and not [*named_files("a.b\0"), *named_files(Path("a.b\0"))]


TABLED = """
from dataclasses import dataclass
from pathlib import Path
from base_of_tabled import Reads

@dataclass(frozen=True)
class Tabled(Reads):
    table: {kind} = {kind}("{name}")
    inner: tuple = ()
"""


@pytest.mark.parametrize("kind", ["str", "Path"])
@pytest.mark.parametrize("name", ["gains.txt", "gains", "tables/gains.json"])
def test_a_field_names_a_file_beside_its_class_its_bases_or_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, name: str
) -> None:
    folders = [tmp_path / one for one in ("code", "base", "here")]
    for folder in folders:
        (folder / name).parent.mkdir(parents=True)
    (folders[0] / "mine.py").write_text(TABLED.format(kind=kind, name=name))
    (folders[1] / "base_of_tabled.py").write_text("class Reads: ...")
    monkeypatch.syspath_prepend(folders[1])
    monkeypatch.delitem(sys.modules, "base_of_tabled", raising=False)
    monkeypatch.chdir(folders[2])
    tabled = importable(folders[0] / "mine.py").Tabled
    found = [plain(tabled())["table"]]
    assert found == [name]
    for folder in folders:
        for text in ("1", "2"):
            (folder / name).write_text(text)
            found.append(plain(tabled(inner=({"of": tabled()},)))["inner"][0]["of"]["table"])
    assert len(set(found)) == 7
    assert plain(Conditions()) == plain(tabled(inner=(Conditions(),)))["inner"][0]


def test_an_mjcf_is_all_that_it_includes_and_refers_to(tmp_path: Path) -> None:
    body, parts, shape = tmp_path / "body.xml", tmp_path / "parts.mjcf", tmp_path / "shapes" / "leg.stl"
    shape.parent.mkdir()
    body.write_text('<mujoco><compiler meshdir="shapes"/><include file="parts.mjcf"/></mujoco>')
    found = set()
    for text in ("<parts/>", "<parts><asset><mesh file='leg.stl'/></asset></parts>"):
        parts.write_text(text)
        for content in (b"a", b"b"):
            shape.write_bytes(content)
            found.add(plain(body))
    assert len(found) == 3


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("a&b.xml", '"a&amp;b.xml"'),
        ("a&b.xml", "'a&#38;b.xml'"),
        ("it's.xml", '"it\'s.xml"'),
        ("a&amp.xml", '"a&amp.xml"'),
    ],
)
def test_an_mjcf_may_include_files_of_any_name(tmp_path: Path, name: str, told: str) -> None:
    (tmp_path / "main.xml").write_text(f"<mujoco><include file={told}/></mujoco>")
    (tmp_path / name).write_text("<mujocoinclude/>")
    before = plain(tmp_path / "main.xml")
    (tmp_path / name).write_text("<mujocoinclude> </mujocoinclude>")
    assert plain(tmp_path / "main.xml") != before


def test_a_mesh_of_a_urdf_counts(tmp_path: Path) -> None:
    (tmp_path / "leg.urdf").write_text('<robot><mesh filename="meshes/leg.stl"/></robot>')
    (tmp_path / "meshes").mkdir()
    found = []
    for text in ("solid", "solid leg"):
        (tmp_path / "meshes" / "leg.stl").write_text(text)
        found.append(plain(tmp_path / "leg.urdf"))
    assert found[0] != found[1]


def test_an_mjcf_in_folders_is_looked_for_beside_each_file(tmp_path: Path) -> None:
    (tmp_path / "sub" / "m").mkdir(parents=True)
    (tmp_path / "main.xml").write_text('<mujoco><include file="sub/legs.xml"/></mujoco>')
    (tmp_path / "sub" / "legs.xml").write_text('<legs><include file="more.xml"/><model file="att.xml"/></legs>')
    (tmp_path / "sub" / "att.xml").write_text('<mujoco><compiler meshdir="m"/><mesh file="b.obj"/></mujoco>')
    found = {plain(tmp_path / "main.xml")}
    for name in ("more.xml", "att.xml", "m/b.obj"):
        with (tmp_path / "sub" / name).open("a") as file:
            file.write(" ")
        found.add(plain(tmp_path / "main.xml"))
    assert len(found) == 4


def test_a_folder_is_said_to_be_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder, is no setting; expected files in fields, or"):
        plain({"tables": tmp_path})
