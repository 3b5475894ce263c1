"""Data that texts of a user's modules name, of which nobody hears who opens it."""

import importlib
from pathlib import Path

import pytest

from hexmj.sweep import code, module_files, named_data
from hexmj.sweeps.code import sources_of_users
from hexmj.sweeps.named_data import data_of_users


@pytest.mark.parametrize(
    ("where", "mine", "helper"),
    [
        ("leg.xml", "'leg.xml'", ""),
        ("models/leg.mjcf", "HERE / 'models' / 'leg.mjcf'", ""),
        ("assets/robots/six/leg.urdf", "HERE / 'assets' / 'robots' / 'six' / 'leg.urdf'", ""),
        ("models/leg.mjb", "MODELS / 'leg.mjb'", "MODELS = HERE / 'models'"),
        ("../models/policy.pt", "HERE.parent / 'models' / 'policy.pt'", ""),
        ("policy.onnx", "f'{HERE}/policy.onnx'", ""),
        ("../../models/leg.xml", "HERE / '..' / '..' / 'models' / 'leg.xml'", ""),
        ("../../models/leg.xml", "'../../models/leg.xml'", ""),
        ("/elsewhere/leg.xml", "'{root}/elsewhere/leg.xml'", ""),
    ],
)
def test_what_libraries_open_by_themselves_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, mine: str, helper: str
) -> None:
    src = tmp_path / "inner" / "src"
    src.mkdir(parents=True)
    (file := Path(f"{tmp_path}{where}" if where.startswith("/") else src / where).resolve()).parent.mkdir(
        parents=True, exist_ok=True
    )
    file.write_text("<mujoco/>")
    here = "from pathlib import Path\nHERE = Path(__file__).parent\n"
    (src / "named_by_helper.py").write_text(f"{here}{helper}\n")
    (src / "named_by_mine.py").write_text(
        f"{here}from named_by_helper import *\nFILE = {mine.format(root=tmp_path, HERE='{HERE}')}\n"
    )
    monkeypatch.syspath_prepend(src)
    monkeypatch.setattr(module_files, "_FILES", {})
    monkeypatch.setattr(code, "_KNOWN", {})
    importlib.invalidate_caches()
    modules = frozenset({"named_by_mine"})
    unheard, others = data_of_users(modules)
    assert {Path(one).name for one in sources_of_users(modules)} == {"named_by_mine.py", "named_by_helper.py"}
    assert [*map(Path, unheard)] == [file] and not others


def test_an_mjcf_that_is_gone_as_it_is_looked_through_is_not_there(tmp_path: Path) -> None:
    assert named_data._parts(tmp_path / "leg.xml") == []
