"""Files of a user's own are modules: loaded once until they are edited, or refused in one sentence."""

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
    [("import nonsense_9", "No module named"), ("def", "invalid syntax"), ("1 / 0", "by zero"), (None, "No such file")],
)
def test_a_file_that_does_not_load_is_refused_in_one_sentence(tmp_path: Path, text: str | None, sentence: str) -> None:
    if text is not None:
        (tmp_path / "mine.py").write_text(text)
    with pytest.raises(InputError, match=rf"mine\.py cannot be loaded: .*{sentence}"):
        importable(tmp_path / "mine.py")


def test_what_a_file_tries_in_vain_does_not_stop_it(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("try:\n    from . import foo\nexcept ImportError:\n    foo = 3")
    assert importable(tmp_path / "mine.py").foo == 3
