"""Every command and snippet of README and docs, and every example, runs; the site is whole and needs no other.

A command stands on a line of its own, indented by four blanks.  Behind `# long` it is parsed and not run, behind
`# refused` it ends with exit code 2.  Those that neither stand in the README nor are the first of their name, and those
of `LONGER`, are run by `make thorough` alone.
"""

import importlib
import os
import re
import runpy
import shutil
import subprocess
import sys
from importlib.metadata import metadata
from pathlib import Path

import numpy as np
import pytest
from hexmj.cli.command_words import checked

import hexmj
from hexmj.cli.commands import options_of
from hexmj.controllers import conformance
from hexmj.controllers.cruse1998 import LDVS, Cruse1998
from hexmj.controllers.named import load_controller
from tiers import few_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
FILES = (ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md")))
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in FILES}
LINES = dict.fromkeys(
    line for text in PAGES.values() for line in re.findall(r"^    hexmj (.+?)(?: +# (.+))?$", text, flags=re.MULTILINE)
)
LONGER = "biology", "converge", "disturb", "map", "reproduce", "search", "terrain"
"""Names of commands that take long even when they are given little to do; none of them stands in the README."""
COMMANDS = [command for command, told in LINES if not told]
LONG = [command for command, told in LINES if told.startswith("long")]
REFUSED = [command for command, told in LINES if told == "refused"]
FIRST = {command.split()[0]: command for command in reversed(COMMANDS)}
"""Name of a command -> the first line that has it."""
EXAMPLES = sorted(one.stem for one in (ROOT / "examples").glob("*.py") if not one.name.startswith("train_"))
"""Those that train for minutes are in `test_learned`, made small."""
LONG_EXAMPLES = "gallery", "servo_hexapod"
"""The one that draws the documentation's films, and one that is run here from fewer starts."""


def blocks(page: str, language: str) -> list[str]:
    """The fenced blocks of a page."""
    return re.findall(rf"```{language}\n(.+?)```", PAGES[page], flags=re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One working folder for all commands: some read what an earlier one wrote."""
    folder = tmp_path_factory.mktemp("documents")
    (folder / "mine.py").write_text(blocks("docs/first_controller.md", "python")[0])
    shutil.copy(hexmj.STICK_INSECT.mjcf, folder / "beetle.xml")
    return folder


@pytest.fixture
def here(folder, monkeypatch, run):
    """In the folder, where a first walk lies."""
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    if not Path("results/walk/manifest.json").exists():
        assert run("walk", "--physical")[0] == 0
    return folder


def test_there_is_something_to_run():
    assert len(COMMANDS) >= 10
    assert len(EXAMPLES) >= 4
    assert all(told in ("", "refused") or told.startswith("long") for _, told in LINES)


SHORT = [
    one for one in COMMANDS if one.split()[0] not in LONGER and (one in PAGES["README.md"] or one in FIRST.values())
]


@pytest.mark.parametrize("command", few_of(COMMANDS, *SHORT))
def test_command(command, here, run):
    """The first of each name in a new process, as it is typed; the others here, where all is imported."""
    if command in FIRST.values():
        subprocess.run([sys.executable, "-m", "hexmj", *command.split()], check=True)
    else:
        code, _, error = run(*command.split())
        assert code == 0, error


@pytest.mark.parametrize("command", LONG)
def test_a_long_command_has_options_that_exist(command):
    assert options_of(checked(command.split()))


def test_commands_within_sentences_have_options_that_exist():
    text = re.sub(r"```.*?```", "", "".join([*PAGES.values(), (ROOT / "CONTRIBUTING.md").read_text()]), flags=re.DOTALL)
    told = {" ".join(one.split()) for one in re.findall(r"`hexmj ([^`]+)`", text)}
    whole = [one for one in told if " " in one and not re.search(r"[A-Z]{4}|--help|--(out|scheduler)$", one)]
    assert len(whole) > 80
    for command in whole:
        assert options_of(checked(command.split())), command


@pytest.mark.thorough
@pytest.mark.parametrize("command", REFUSED)
def test_refused(command, here, run):
    assert run(*command.split())[0] == 2


def test_targets_and_extras_exist():
    text, makefile = "".join(PAGES.values()), (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in set(re.findall(r"(?:^    |`)make (\w+)", text, flags=re.MULTILINE)):
        assert re.search(rf"^[\w ]*\b{target}\b[\w ]*:", makefile, flags=re.MULTILINE), target
    extras = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("[project.optional-dependencies]")[2]
    for named in set(re.findall(r'pip install "\.\[([\w,]+)\]"', text)):
        for extra in named.split(","):
            assert f"\n{extra} = [" in extras, extra


def test_snippet(folder):
    (snippet,) = blocks("README.md", "python")
    done = subprocess.run([sys.executable, "-c", snippet], cwd=folder, check=True, capture_output=True, text=True)
    kinematic, physical = map(float, done.stdout.splitlines()[:2])
    assert 0 < physical < kinematic < 1


@pytest.mark.parametrize("page", [page for page in PAGES if page != "README.md" and blocks(page, "python")])
def test_python_of_a_page(page, here):
    """One program from top to bottom."""
    names = {"__name__": page}
    for block in blocks(page, "python"):
        exec(compile(block, page, "exec"), names)


def test_parameter_file(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(blocks("docs/commands.md", "toml")[0])
    read = load_controller(str(path))
    assert isinstance(read, Cruse1998)
    assert read.weights == LDVS.weights


@pytest.mark.parametrize("example", few_of(EXAMPLES, *[one for one in EXAMPLES if one not in LONG_EXAMPLES]))
def test_example(example, folder, monkeypatch):
    """As `python examples/NAME.py` does, but here, where all is imported and warnings are errors; the first in a new
    process.  That no order of imports matters is held by `test_layers`."""
    monkeypatch.chdir(folder)
    path = str(ROOT / "examples" / f"{example}.py")
    if example == EXAMPLES[0]:
        subprocess.run([sys.executable, path], check=True)
    else:
        monkeypatch.syspath_prepend(ROOT / "examples")
        monkeypatch.setattr(sys, "argv", [path])
        runpy.run_path(path, run_name="__main__")


def test_the_servo_hexapod_from_fewer_starts(tmp_path):
    small = "import servo_hexapod; servo_hexapod.main(n_starts=2)"
    paths = os.pathsep.join([str(ROOT), str(ROOT / "examples"), os.environ.get("PYTHONPATH", "")])
    subprocess.run([sys.executable, "-c", small], cwd=tmp_path, env=os.environ | {"PYTHONPATH": paths}, check=True)


def test_the_servo_hexapods_controller_walks_as_the_insect_walks_four_times_as_large(monkeypatch):
    """Lines, that is where its rivals' tips lie, among what it plans for."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    larger = importlib.import_module("servo_hexapod").Larger()
    small, starts = hexmj.Stride(), hexmj.draw_starts(40, 5)
    wide = hexmj.Geometry(*(tuple(4 * end for end in ends) for ends in vars(small.geometry).values()))
    large = hexmj.Stride(aep0=40.0, pep0=-40.0, pep_min=-80.0, dt=0.4, geometry=wide)
    ours = hexmj.loss_time(hexmj.walk(4 * starts, larger, 0.5, 720.0, stride=large))
    assert np.array_equal(ours, 4 * hexmj.loss_time(hexmj.walk(starts, hexmj.LDVS, 0.5, 180.0, stride=small)))
    conformance.check_controller(larger, large)


def test_the_site_is_whole_and_loads_nothing_from_elsewhere(tmp_path):
    """Warnings of MkDocs are errors: pages and anchors that are not there, docstrings that do not fit."""
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True)
    pages = sorted(tmp_path.rglob("*.html"))
    loading = re.compile(r"<(?:script|link|img|iframe|source|video)\b[^>]*(?:src|href)=[\"']?(?:https?:)?//")
    assert len(pages) >= len(PAGES)
    for page in pages:
        assert not loading.search(page.read_text(encoding="utf-8")), page
    for sheet in tmp_path.rglob("*.css"):
        assert not re.search(r"@import|url\([\"']?(?:https?:)?//", sheet.read_text(encoding="utf-8")), sheet


def test_a_package_index_is_told_nothing_by_relative_paths():
    told = str(metadata("hexmj").json["description"])
    assert told.count("# hexmj") == 1 and "## A dozen lines" in told
    assert not re.findall(r"\]\((?!https://)", told)
