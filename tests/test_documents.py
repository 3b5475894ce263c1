"""Commands and Python of README and docs, examples and notebooks run; links, targets and the site are whole.

A command stands on a line of its own, indented by four blanks. With `# long` behind it, it is only parsed.
"""

import importlib
import json
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj.cli import main
from hexmj.controllers.conformance import check_controller

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs/tutorials").glob("*.ipynb"))
FILES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md")), *sorted(ROOT.glob("docs/**/*.md")), *NOTEBOOKS]


def text_of(path: Path) -> str:
    """Return the text of a page; of a notebook, only its Markdown."""
    text = path.read_text(encoding="utf-8")
    if path not in NOTEBOOKS:
        return text
    return "\n\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown")


PAGES = {path.relative_to(ROOT).as_posix(): text_of(path) for path in FILES}
LINES = dict.fromkeys(re.findall(r"^    hexmj (.+?)(?: +# (.+))?$", "\n".join(PAGES.values()), flags=re.MULTILINE))
COMMANDS = [command for command, comment in LINES if not comment.startswith("long")]
EXAMPLES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
LONG_EXAMPLES = {"gallery", "insects", "model_variants", "servo_hexapod", "train_cma", "train_ppo", "variants"}
"""Examples that take minutes. Their functions are tested at a small size, here, in test_learned or by features.py."""


def blocks(page: str) -> list[str]:
    """Return the Python blocks of a page."""
    return re.findall(r"```python\n(.+?)```", PAGES[page], flags=re.DOTALL)


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """One folder for all commands, because some read what an earlier one wrote."""
    folder = tmp_path_factory.mktemp("documents")
    (folder / "mine.py").write_text(blocks("docs/howto/controller.md")[0])
    shutil.copy(hexmj.STICK_INSECT.mjcf, folder / "beetle.xml")
    return folder


@pytest.fixture
def folder(shared, monkeypatch, run):
    """Work in the folder, which has a first walk."""
    monkeypatch.chdir(shared)
    monkeypatch.syspath_prepend(shared)
    if not Path("results/walk/manifest.json").exists():
        assert run("walk", "--velocity", 0.5, "--physical")[0] == 0
    return shared


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_command(command, folder, run):
    code, _, error = run(*command.split())
    assert code == 0, error


def test_commands_have_options_that_exist(monkeypatch):
    """Those on lines and those within sentences."""
    text = re.sub(r"```.*?```", "", "".join(PAGES.values()), flags=re.DOTALL)
    quoted = {" ".join(words.split()) for words in re.findall(r"`hexmj ([^`]+)`", text)}
    quoted = {c for c in quoted if " --" in c and not re.search(r"[A-Z]{4}|\.\.\.|--(help|out|scheduler)$", c)}
    wrong = []
    for command in {*quoted, *(command for command, _ in LINES)}:
        name, *words = command.split()
        if name.startswith("--"):
            continue
        monkeypatch.setattr(type(main.command(name)), "run", lambda self, given: None)
        try:
            main.run([name, *words])
        except (SystemExit, hexmj.InputError):
            wrong.append(command)
    assert wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page) and not page.endswith(".ipynb")])
def test_python_of_a_page(page, folder, request):
    """All blocks of a page are one program."""
    if "import dm" in PAGES[page]:
        request.getfixturevalue("dm")
    names = {"__name__": page}
    for block in blocks(page):
        exec(compile(block, page, "exec"), names)


@pytest.mark.slow
@pytest.mark.parametrize("example", [name for name in EXAMPLES if name not in LONG_EXAMPLES])
def test_example(example, folder, monkeypatch, request):
    if "import dm" in (ROOT / "examples" / f"{example}.py").read_text(encoding="utf-8"):
        request.getfixturevalue("dm")
    monkeypatch.syspath_prepend(ROOT / "examples")
    monkeypatch.setattr(sys, "argv", [f"{example}.py"])
    runpy.run_path(str(ROOT / "examples" / f"{example}.py"), run_name="__main__")


@pytest.mark.slow
def test_the_servo_hexapod_walks_and_its_controller_scales(folder, monkeypatch):
    """Losses of a controller for steps four times as long are those of the insect, four times as late."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    robot = importlib.import_module("servo_hexapod")
    robot.main(n_starts=2)
    starts, stride = hexmj.draw_starts(40, 5), hexmj.Stride()
    lines = 4 * np.array([stride.geometry.origins, stride.geometry.lateral])
    wide = hexmj.Geometry(*map(tuple, lines.tolist()))
    large = hexmj.Stride(aep0=40.0, pep0=-40.0, pep_min=-80.0, dt=0.4, geometry=wide)
    scaled = hexmj.loss_time(hexmj.walk(4 * starts, robot.Larger(), 0.5, 720.0, stride=large))
    assert np.array_equal(scaled, 4 * hexmj.loss_time(hexmj.walk(starts, hexmj.LDVS, 0.5, 180.0, stride=stride)))
    check_controller(robot.Larger(), large)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_and_its_solution_run(path: Path, monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    book, empty = json.loads(path.read_text(encoding="utf-8")), {"metadata": {}, "outputs": [], "execution_count": None}
    for n, solution in enumerate(blocks(path.relative_to(ROOT).as_posix())):
        book["cells"].append({"cell_type": "code", "id": f"solution-{n}", "source": solution, **empty})
    (solved := tmp_path / path.name).write_text(json.dumps(book), encoding="utf-8")
    code = "import sys; from pathlib import Path; import notebooks; notebooks.executed(Path(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(solved)], cwd=ROOT / "docs", check=True)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_stores_its_output(path: Path):
    assert path.stat().st_size < 400_000
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    stored = json.dumps([cell["outputs"] for cell in cells])
    assert [cell["execution_count"] for cell in cells] == [*range(1, len(cells) + 1)], "run from top to bottom"
    assert "image/png" in stored and "Traceback" not in stored and '"stderr"' not in stored
    assert not re.search(r"/(tmp|home|root|work|Users)/", stored)


def test_targets_extras_and_links_exist():
    text, makefile = "".join(PAGES.values()), (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in set(re.findall(r"(?:^    |`)make (\w+)", text, flags=re.MULTILINE)):
        assert re.search(rf"^[\w ]*\b{target}\b[\w ]*:", makefile, flags=re.MULTILINE), target
    extras = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("[project.optional-dependencies]")[2]
    for names in set(re.findall(r'pip install "\.\[([\w,]+)\]"', text)):
        assert all(f"\n{extra} = [" in extras for extra in names.split(",")), names
    for page, content in PAGES.items():
        for link in re.findall(r"\]\((?!https?:)([^)#\s]+)", content):
            assert (ROOT / page).parent.joinpath(link).exists(), (page, link)
    package = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("hexmj/**/*.py"))
    named = {*re.findall(r"\bdocs/[\w/]+\.\w+", package)}
    named |= {path for path in re.findall(r"\b(?:docs|examples|benchmarks|tests|hexmj)/[\w/]+\.(?:py|md|png)", text)}
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_the_reference_has_each_public_name_once():
    places = re.findall(r"^::: (\S+)", "\n".join(PAGES.values()), flags=re.MULTILINE)
    assert len(places) == len(set(places))
    assert {f"hexmj.{name}" for name in dir(hexmj)} - set(places) == {"hexmj.__version__"}


@pytest.mark.slow
def test_the_site_is_whole_and_loads_nothing_from_elsewhere(tmp_path):
    """MkDocs treats missing pages, anchors and names as errors."""
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True)
    loading = re.compile(r"<(?:script|link|img|iframe|source|video)\b[^>]*(?:src|href)=[\"']?(?:https?:)?//")
    for page in tmp_path.rglob("*.html"):
        assert not loading.search(page.read_text(encoding="utf-8")), page
    for sheet in tmp_path.rglob("*.css"):
        assert not re.search(r"@import|url\([\"']?(?:https?:)?//", sheet.read_text(encoding="utf-8")), sheet
