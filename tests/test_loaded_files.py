"""Files of a user's own are modules: loaded once until they are edited, or refused in one sentence."""

import sys
from pathlib import Path

import pytest

from hexmj.errors import InputError
from hexmj.user_code.loaded import importable
from small_cells import MINE


def test_a_file_is_loaded_once_until_it_is_edited(tmp_path: Path) -> None:
    mine = tmp_path / "mine [1]. ö.py"
    mine.write_text(MINE)
    first = importable(mine)
    assert importable(str(mine)) is first and first.__file__ == str(mine)
    mine.write_text(MINE + "\nWIDTH = 3")
    second = importable(mine)
    assert second is not first and second.WIDTH == 3 and not hasattr(first, "WIDTH")
    assert list(tmp_path.iterdir()) == [mine]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("import nonsense_9", "No module named"),
        ("from .helper import X", "it imports relatively; expected module:object of its package"),
        ("from . import helper", "it imports relatively"),
        ("from ..helper import X", "it imports relatively"),
        ("def", "invalid syntax"),
        ("1 / 0", "by zero"),
        (None, "No such file"),
    ],
)
def test_a_file_that_does_not_load_is_refused_in_one_sentence(tmp_path: Path, text: str | None, sentence: str) -> None:
    if text is not None:
        (tmp_path / "mine.py").write_text(text)
    with pytest.raises(InputError, match=rf"mine\.py cannot be loaded: .*{sentence}"):
        importable(tmp_path / "mine.py")


def test_what_a_file_tries_in_vain_does_not_stop_it(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("try:\n    from . import foo\nexcept ImportError:\n    foo = 3")
    assert importable(tmp_path / "mine.py").foo == 3


@pytest.mark.parametrize("helper", ["helper.py", "helper/__init__.py", "helper/gains.py", "deep.py"])
def test_a_helper_of_another_folder_is_refused_where_one_lies_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, helper: str
) -> None:
    """Two versions of a project in one program: Python knows one module of a name."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    names = "helper", "helper.gains", "deep", "by_v1", "by_v2"
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    for version in ("v1", "v2"):
        (file := tmp_path / version / helper).parent.mkdir(parents=True)
        file.write_text(f"GAIN = {version!r}")
        (tmp_path / version / f"by_{version}.py").write_text("from deep import GAIN")
        of = {"helper/gains.py": "helper.gains", "deep.py": f"by_{version}"}.get(helper, "helper")
        finds = f"import sys\nsys.path.insert(0, {str(tmp_path / version)!r})\nfrom {of} import GAIN\nimport json"
        (tmp_path / version / "mine.py").write_text(finds)
    assert importable(tmp_path / "v1" / "mine.py").GAIN == "v1"
    with pytest.raises(InputError, match=r"v2.*\.py imports .*, which is .*v1.* in this program, though .*v2"):
        importable(tmp_path / "v2" / "mine.py")
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert importable(tmp_path / "v2" / "mine.py").GAIN == "v2"
