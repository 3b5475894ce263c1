"""A user's project of several modules and scripts, and the record of a cell in it."""

import subprocess
import sys
from pathlib import Path

from small_cells import MINE, WITHOUT_DASK

TOY = {
    "toy/__init__.py": "from toy.louder import louder\nfrom toy.walk import walk\nwalk = louder(walk)",
    "toy/study.py": "import numpy\nfrom toy import walk\nfrom typing import TYPE_CHECKING\n"
    "if TYPE_CHECKING:\n    import toy.film\ndef cell(controller=None): ...",
    "toy/louder.py": "def louder(what): return what",
    "toy/walk.py": "def walk():\n    import toy.inner.deep\n    return deep",
    "toy/inner/__init__.py": "GAIN = 1",
    "toy/inner/deep.py": "from . import deeper",
    "toy/inner/deeper.py": "import scipy.stats",
    "toy/film.py": "import matplotlib\ndef show(): ...",
    "toy/cli.py": "import toy.study",
    "helper.py": "",
    "bare/helper.py": "",
    "bare/deep/other.py": "",
    "gaits/__init__.py": "__all__ = 'wave'.split()",
    "gaits/wave.py": "",
    "gaits/never.py": "this is no Python",
    "whole/__init__.py": "",
    "whole/part/__init__.py": "",
    "whole/part/deep.py": "",
    "fast.pyc": "",
    "mine.py": "from helper import *\nfrom gaits import *\nfrom bare import helper\nimport bare.deep.other\n"
    "import whole\nif not True:\n    import fast\n" + MINE,
}

PRINT_STEM = """
from hexmj.user_code.loaded import importable
from hexmj.sweep import Cell
from toy.study import cell
print(Cell("toy", cell, {"controller": importable("mine.py").Tripod()}).record())
"""


def toy_record(folder: Path) -> str:
    command = [sys.executable, "-c", PRINT_STEM]
    return subprocess.run(command, cwd=folder, env=WITHOUT_DASK, capture_output=True, text=True, check=True).stdout


def write_toy(tmp_path: Path) -> Path:
    for name, text in TOY.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path
