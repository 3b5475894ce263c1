"""Imports go down the layers only, and the kinematic side never imports MuJoCo."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1] / "hexmj"

LAYERS = (
    ("foundation",),
    ("sweep", "io", "plotting"),
    ("controllers", "conditions"),
    ("bodies",),
    ("physics",),
    ("measures", "gaits"),
    ("studies", "rendering"),
    ("search", "tasks", "environments", "replay"),
    ("paper", "league", "view"),
    ("cli",),
    ("__main__", ""),
)
"""Folders and top-level files from the bottom; top-level files that are not named belong to the foundation."""

LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def room(module: str) -> str:
    """Return the folder or top-level file that a module belongs to."""
    first = module.partition(".")[0]
    return first if first in LEVEL else "foundation"


def imported(source: str) -> set[str]:
    """Return everything that a source imports, also inside functions, each name as if it were a module."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def graph() -> dict[str, set[str]]:
    """Return the modules of the package that each of its modules imports."""
    files = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in ROOT.rglob("*.py")}
    files = {name.removesuffix("__init__").removesuffix("."): path for name, path in files.items()}
    edges = {}
    for module, path in files.items():
        own = {name.removeprefix("hexmj.") for name in imported(path.read_text("utf-8")) if name.startswith("hexmj.")}
        edges[module] = {name if name in files else name.rpartition(".")[0] for name in own} - {module}
    return edges


def test_imports_go_down():
    wrong = [
        f"{module} imports {other}"
        for module, others in graph().items()
        for other in others
        if room(module) != room(other) and LEVEL[room(other)] >= LEVEL[room(module)]
    ]
    assert wrong == []


def test_no_circles():
    TopologicalSorter(graph()).prepare()


def test_flss_imports_neither_mujoco_nor_xarray_nor_matplotlib():
    script = (
        "import sys, hexmj\n"
        "hexmj.first_loss(hexmj.draw_starts(10, seed=0), hexmj.LDVS, 0.5, 10.0)\n"
        "hexmj.walk(hexmj.draw_starts(1, seed=0), hexmj.LDVS, 0.5, 10.0)\n"
        "print([name for name in ('mujoco', 'dm_control', 'xarray', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_one_module_steps_mujoco_in_bulk():
    users = [path for path in ROOT.rglob("*.py") if "mujoco.batch.Batch" in imported(path.read_text("utf-8"))]
    assert len(users) == 1, users
