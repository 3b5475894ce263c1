"""Every command and snippet of the README, and every example, runs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from hexmj.controllers.cruse1998 import LDVS, Cruse1998
from hexmj.controllers.named import load_controller

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    hexmj (.+)$", README, flags=re.MULTILINE)
FIRST = {command.split()[0]: command for command in reversed(COMMANDS)}
"""Name of a command -> the first line that has it."""
EXAMPLES = sorted(one for one in (ROOT / "examples").glob("*.py") if not one.name.startswith("train_"))
"""Those that train for minutes are in `test_learned`, made small."""


SNIPPET, CONTROLLER = re.findall(r"```python\n(.+?)```", README, flags=re.DOTALL)
(WEIGHTS,) = re.findall(r"```toml\n(.+?)```", README, flags=re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One working folder for all commands: some read what an earlier one wrote."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "mine.py").write_text(CONTROLLER)
    return folder


def test_there_is_something_to_run():
    assert len(COMMANDS) >= 10
    assert len(EXAMPLES) >= 4


@pytest.mark.parametrize("command", COMMANDS)
def test_command(command, folder, run, monkeypatch):
    """The first of each name in a new process, as it is typed; the others here, where all is imported."""
    monkeypatch.chdir(folder)
    if "results/walk" in command and not Path("results/walk/manifest.json").exists():
        assert run("walk", "--physical")[0] == 0
    if command in FIRST.values():
        subprocess.run([sys.executable, "-m", "hexmj", *command.split()], check=True)
    else:
        code, _, error = run(*command.split())
        assert code == 0, error


def test_snippet(folder):
    done = subprocess.run([sys.executable, "-c", SNIPPET], cwd=folder, check=True, capture_output=True, text=True)
    kinematic, physical = map(float, done.stdout.splitlines()[:2])
    assert 0 < physical < kinematic < 1


def test_parameter_file(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(WEIGHTS)
    read = load_controller(str(path))
    assert isinstance(read, Cruse1998)
    assert read.weights == LDVS.weights


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, folder):
    subprocess.run([sys.executable, str(example)], cwd=folder, check=True)
