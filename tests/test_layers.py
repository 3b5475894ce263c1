"""The house stands on its floors: no file imports one that stands above it, and those below know nothing of MuJoCo."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = (
    ("checks", "errors", "intervals", "jitted", "labels", "legs", "phases", "rotations", "storage", "version"),
    ("field_docs", "pictures", "process", "user_code"),
    ("sweeps",),  # knows nothing of walking
    ("diagrams", "timing"),
    ("stability", "walks"),
    ("starts",),
    ("controllers",),
    ("gaits", "measures.frequency", "measures.kinematic", "measures.velocities", "variants"),
    ("body", "body", "conditions"),
    ("bodies",),
    ("physics",),
    ("measures", "rendering"),
    ("paper", "search", "studies"),
    ("environments", "plots", "replay", "view"),
    ("registering",),
    ("__main__", "cli"),
)
"""From the ground up; a package stands where the longest name stands that its own begins with."""

KINEMATIC = FLOORS[:8]
"""Floors of planning, of measuring on paper and of describing bodies; they never import MuJoCo."""

MUJOCO = {"mujoco.batch": ("physics.backend",), "dm_control": ("environments",)}
"""What few modules alone may import."""

NO_FLOOR = {""}
"""The package itself: names are imported when they are first used."""


class Imports(ast.NodeVisitor):
    """Names of all modules that a file imports as it runs, in functions too, and not only for type checkers."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def visit_If(self, node: ast.If) -> None:
        checked = "TYPE_CHECKING" in ast.unparse(node.test)
        for one in (*([] if checked else node.body), *node.orelse):
            self.visit(one)

    def visit_Import(self, node: ast.Import) -> None:
        self.names += [one.name for one in node.names]

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        assert node.level == 0, "imports name their module in full"
        self.names += [f"{node.module}.{one.name}" for one in node.names]


@cache
def imported(source: str) -> list[str]:
    """Everything imported by a source, each with its name as if it were a module."""
    found = Imports()
    found.visit(ast.parse(source))
    return found.names


def sources() -> dict[str, str]:
    """The package's modules, by their names in it."""
    files = {path.relative_to(ROOT / "hexmj").with_suffix(""): path for path in (ROOT / "hexmj").rglob("*.py")}
    names = {".".join(part for part in name.parts if part != "__init__"): path for name, path in files.items()}
    return {name: path.read_text(encoding="utf-8") for name, path in names.items()}


def floor(module: str) -> int:
    """Number of the floor on which a module stands."""
    fitting = [
        (len(name), i)
        for i, names in enumerate(FLOORS)
        for name in names
        if module == name or module.startswith(f"{name}.")
    ]
    assert fitting, f"{module} has no floor"
    return max(fitting)[1]


def graph(modules: dict[str, str]) -> dict[str, set[str]]:
    """Which modules of the package each one imports; a name imported from a module counts as that module."""

    def inside(names: list[str]) -> Iterator[str]:
        for name in names:
            if name == "hexmj" or name.startswith("hexmj."):
                own = name.removeprefix("hexmj").removeprefix(".")
                yield own if own in modules else own.rpartition(".")[0]

    return {name: set(inside(imported(source))) for name, source in modules.items()}


def upward(modules: dict[str, str]) -> list[str]:
    """Imports of what stands above, as sentences."""
    return [
        f"{name} imports {other}"
        for name, others in graph(modules).items()
        for other in others
        if name not in NO_FLOOR and (other in NO_FLOOR or floor(other) > floor(name))
    ]


def test_no_file_imports_one_that_stands_above_it():
    assert upward(sources()) == []


def test_no_two_files_import_each_other():
    """Nor does any longer way lead back."""
    try:
        TopologicalSorter(graph(sources())).prepare()
    except CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("starts", "from hexmj.conditions import Conditions"),
        ("sweeps.grid", "from hexmj.timing import Stride"),
        ("body", "from hexmj.bodies import loading"),
        ("measures.kinematic", "def later():\n    import hexmj.measures.physical"),
        ("physics.drive", "from hexmj import compare"),
    ],
)
def test_an_import_of_what_stands_above_would_be_seen(module: str, line: str):
    modules = sources()
    modules[module] += f"\n{line}\n"
    (sentence,) = upward(modules)
    assert sentence.startswith(f"{module} imports ")


def test_what_type_checkers_alone_import_is_no_import():
    source = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import mujoco\nelse:\n    import ast\n"
    assert imported(source) == ["typing.TYPE_CHECKING", "ast"]


def kinematic_modules() -> list[str]:
    """Names of the modules on the floors that know nothing of MuJoCo."""
    return [name for name in sources() if name not in NO_FLOOR and floor(name) < len(KINEMATIC)]


def test_the_kinematic_floors_name_neither_mujoco_nor_dm_control():
    modules = sources()
    names = {name: imported(modules[name]) for name in kinematic_modules()}
    assert len(names) > 30
    named = [f"{name} imports {one}" for name, ones in names.items() for one in ones if _of_mujoco(one)]
    assert named == []


def _of_mujoco(name: str) -> bool:
    return name.split(".")[0] in ("mujoco", "dm_control")


def test_whoever_imports_the_kinematic_floors_has_not_imported_mujoco():
    """In a process of its own; the package's top belongs to them."""
    lines = [f"import hexmj.{name}" for name in kinematic_modules()]
    lines += ["import hexmj, sys", "print([one for one in ('mujoco', 'dm_control', 'xarray') if one in sys.modules])"]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_kinematic_side_never_imports_mujoco():
    script = (
        "import sys, numpy as np, hexmj\n"
        "hexmj.flss(hexmj.LDVS, [0.5], n_starts=10); hexmj.walk(np.zeros((1, 6)), hexmj.LDVS, 0.5, 10.0)\n"
        "assert 'mujoco' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize("library", MUJOCO)
def test_few_modules_know_what_steps_the_bodies(library: str):
    """A second engine is one file more."""
    users = [
        name
        for name, source in sources().items()
        if any(one == library or one.startswith(f"{library}.") for one in imported(source))
    ]
    assert users
    assert all(name.startswith(MUJOCO[library]) for name in users), users
