"""Compiled code is kept for as long as all that it is made of is the same."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj import rotations, stability
from hexmj.bodies import newton
from hexmj.controllers.cruse1998 import kernel
from hexmj.environments import compiled_passes
from hexmj.jitted import _made_of, _told
from hexmj.physics import outcomes
from tiers import few_of

HELPER = "from hexmj.jitted import jitted\nFACTOR = 2.0\n@jitted\ndef inner(x):\n    return x + 1.0\n"
OUTER = "from hexmj.jitted import jitted\nfrom helper import FACTOR, inner\n@jitted\ndef outer(x):\n"
OUTER += "    return FACTOR * inner(x)\nprint(outer(1.0), *outer.stats.cache_hits.values())\n"


def ran(folder: Path) -> list[float]:
    """What the outer function says in a process of its own, and 1 if it was compiled before."""
    outer = [sys.executable, "outer.py"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kept")}
    done = subprocess.run(outer, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    return [float(word) for word in done.stdout.split()]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "told"),
    few_of(
        [
            ("+ 1.0", "+ 5.0", 12.0),
            ("FACTOR = 2.0", "FACTOR = 3.0", 6.0),
            ("FACTOR = 2.0", "import numpy\nFACTOR = numpy.float32(2.0)", 4.0),
            ("", "", 4.0),
        ],
        *[("+ 1.0", "+ 5.0", 12.0), ("FACTOR = 2.0", "FACTOR = 3.0", 6.0)],
    ),
)
def test_an_edit_of_another_file_is_compiled(tmp_path, old, new, told):
    for name, text in (("helper", HELPER), ("outer", OUTER)):
        (tmp_path / f"{name}.py").write_text(text)
    assert ran(tmp_path) == [4.0]
    assert ran(tmp_path) == [4.0, 1.0]
    (tmp_path / "helper.py").write_text(HELPER.replace(old, new))
    assert ran(tmp_path) == ([told] if new else [4.0, 1.0])


@pytest.mark.thorough
def test_helpers_that_stand_below_count_too(tmp_path):
    """And what they take from other files."""
    low = OUTER.replace("return FACTOR * inner(x)", "return below(x)")
    low = low.replace("print(", "@jitted\ndef below(x):\n    return FACTOR * inner(x)\nprint(")
    for name, text in (("helper", HELPER), ("outer", low)):
        (tmp_path / f"{name}.py").write_text(text)
    assert ran(tmp_path) == [4.0]
    (tmp_path / "helper.py").write_text(HELPER.replace("FACTOR = 2.0", "FACTOR = 3.0"))
    assert ran(tmp_path) == [6.0]


@pytest.mark.slow
def test_a_function_may_call_itself(tmp_path):
    text = "from hexmj.jitted import jitted\n@jitted\ndef outer(n):\n    return 1 if n < 2 else n * outer(n - 1)\n"
    (tmp_path / "outer.py").write_text(text + "print(outer(5))\n")
    assert ran(tmp_path) == [120.0]


def test_what_the_package_compiles_is_told_the_same_in_any_process(monkeypatch):
    """No address of an object is in it, with which nothing that is kept would ever be found again; nor how numbers are
    printed, nor by which of two paths an environment is reached."""
    modules = kernel, stability, rotations, newton, compiled_passes, outcomes
    compiled = [one.py_func for module in modules for one in vars(module).values() if hasattr(one, "py_func")]
    assert len(compiled) > 30
    told = list(map(_made_of, compiled))
    assert not any(" at 0x" in one for one in told)
    monkeypatch.setattr(np.__spec__, "origin", "elsewhere")
    with np.printoptions(legacy="1.25"):
        assert list(map(_made_of, compiled)) == told


DAMAGED = (
    lambda before, now: before,
    lambda before, now: flipped(now, len(now) // 2),
    lambda before, now: now[: len(now) // 2],
    lambda before, now: b"",
)


@pytest.mark.slow
@pytest.mark.parametrize("damaged", few_of(DAMAGED, DAMAGED[0]))
def test_code_that_is_another_or_damaged_is_compiled_anew(tmp_path, damaged):
    """An index is renewed before its code: where the disk is full then, it names the code from before the edit."""
    text = "from hexmj.jitted import jitted\n@jitted\ndef outer(x):\n    return x + 1.0\n"
    text += "print(outer(1.0), *outer.stats.cache_hits.values())\n"
    (tmp_path / "outer.py").write_text(text)
    assert ran(tmp_path) == [2.0]
    (code,) = tmp_path.glob("kept/*/*.nbc")
    before = code.read_bytes()
    (tmp_path / "outer.py").write_text(text.replace("+ 1.0", "+ 55.0"))
    assert ran(tmp_path) == [56.0]
    code.write_bytes(damaged(before, code.read_bytes()))
    assert ran(tmp_path) == [56.0]
    assert ran(tmp_path) == [56.0, 1.0]


@pytest.mark.slow
def test_code_of_other_types_is_compiled_anew(tmp_path):
    """As two processes leave it that compile for other types at once."""
    text = "import numpy as np\nfrom hexmj.jitted import jitted\n@jitted\ndef outer(x):\n    return x + 1.0\n"
    (tmp_path / "outer.py").write_text(text + "print(outer(1.0), outer(np.ones(2))[0])\n")
    assert ran(tmp_path) == [2.0, 2.0]
    one, other = sorted(tmp_path.glob("kept/*/*.nbc"))
    other.write_bytes(one.read_bytes())
    assert ran(tmp_path) == [2.0, 2.0]


def flipped(data: bytes, place: int) -> bytes:
    """With one bit turned."""
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


def test_arrays_count_to_their_last_number_and_bit():
    """Of which NumPy prints eight digits, and of many numbers a few."""
    numbers = np.arange(5000.0)
    for place in (1, 2500):
        other = numbers.copy()
        other[place] = np.nextafter(other[place], np.inf)
        assert _told(other) != _told(numbers) == _told(numbers.copy())
    assert _told(numbers.astype(int)) != _told(numbers)


def test_whatever_is_kept_stands_under_a_checksum():
    """numba's own `cache=True` has none."""
    sources = Path(hexmj.__file__).parent.rglob("*.py")
    assert [one.name for one in sources if "cache=True" in one.read_text()] == ["jitted.py"]
