"""The notebooks run, and what is stored in them is there, small, and of no machine."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [pytest.param(one, id=one.stem, marks=pytest.mark.thorough if i else ()) for i, one in enumerate(NOTEBOOKS)],
)
def test_a_notebook_runs(path: Path):
    words = [sys.executable, "-m", "pytest", "--nbmake", "-p", "no:cacheprovider", "-o", "filterwarnings=", str(path)]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(words, cwd=ROOT, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_shows_is_stored(path: Path):
    assert path.stat().st_size < 400_000
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    shown = json.dumps([cell["outputs"] for cell in cells])
    assert [cell["execution_count"] for cell in cells] == [*range(1, len(cells) + 1)], "run from top to bottom"
    assert "image/png" in shown
    assert "Traceback" not in shown
    assert not re.search(r"/(tmp|home|root|work|Users)/", shown)
    assert '"stderr"' not in shown


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["first_walk", "paper_and_physics", "your_own_controller"]
