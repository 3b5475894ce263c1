"""`python -m tests.soak.mutants [GROUP...] --sample N --seed S`: how many small faults of the source the tests notice.

One fault at a time is put into a copy of the project, and the quick tests of that module run there until one fails.
The faults are those of cosmic-ray: another operator, another comparison, a number off by one, a condition negated.
"""

import ast
import os
import random
import shutil
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from queue import Queue
from subprocess import DEVNULL
from tempfile import TemporaryDirectory

from hexmj.stats import wilson_interval

ROOT = Path(__file__).parents[2]
COPIED = ("hexmj", "tests", "assets", "examples", "pyproject.toml")

SECONDS = 300.0
"""Longer than the tests of any module take on a busy machine; a mutant that is still running then is killed."""

NARROW = ("LANES = 64\n", "LANES = 3\n")
"""The kernel without its compiler is as slow as it is wide; what it gives does not depend on that."""

MEASURING = "tests/test_measuring.py"
WALKS = "fed_back or batch or told or lifted or settled or push_gives or reach or diverge or progress or grasp or roll"
MEASURES = (
    "chunks_show or tracking or beyond or belong or settled or whole or after_a_fall or bounce or follow or reach"
    " or any_batch or test_measuring"
)
FELT = f"{WALKS} or bounce or test_measuring"

CONFTEST = """
from hypothesis import Phase, settings

settings.register_profile("mutants", phases=(Phase.explicit, Phase.generate), database=None, derandomize=True)
settings.load_profile("mutants")
"""
"""No time is spent on making the example that killed a mutant a small one."""


@dataclass(frozen=True)
class Module:
    """A module and its tests."""

    path: str
    """From `hexmj` on."""
    tests: tuple[str, ...]
    """Files."""
    chosen: str
    """What pytest chooses from them (`-k`)."""
    compiled: bool = True
    """Whether numba compiles."""
    replaced: tuple[str, str] = ("", "")
    """A text of the module that is another one in all mutants."""

    @cached_property
    def text(self) -> str:
        """Its source; ASCII alone, so that a column counts characters."""
        return (ROOT / "hexmj" / self.path).read_text("ascii")


GROUPS = {
    "network": (
        Module(
            "controllers/cruse1998/kernel.py",
            ("tests/test_network.py",),
            "not (number_of_lanes or comes_back or published or 3000 or mirrored or range)",
            compiled=False,
            replaced=NARROW,
        ),
        Module(
            "controllers/cruse1998/network.py",
            ("tests/test_network.py", "tests/test_first_losses.py", "tests/test_conformance.py"),
            "test_network and not (number_of_lanes or comes_back) or fast_losses or network_conforms",
        ),
    ),
    "stability": (Module("stability.py", ("tests/test_stability.py",), ""),),
    "losses": (
        Module("measures/kinematic.py", ("tests/test_stability.py", "tests/test_loss_frequency.py"), ""),
        Module(
            "controllers/losses.py",
            ("tests/test_first_losses.py", "tests/test_reading_legs.py", "tests/test_refused_plans.py"),
            "first_losses or makes_no_sense or on_paper",
        ),
    ),
    "drive": (
        Module("physics/drive.py", ("tests/test_closed_loop.py", "tests/test_physics.py"), WALKS),
        Module("physics/orders.py", ("tests/test_closed_loop.py", "tests/test_physics.py"), WALKS),
        Module("physics/foot_path.py", ("tests/test_targets.py",), ""),
    ),
    "stepping": (
        Module("physics/fine_steps.py", ("tests/test_strikes.py",), "not (sink_in or nobody_else or depth_is)"),
        Module(
            "physics/backend.py",
            ("tests/test_physics.py", "tests/test_strikes.py", "tests/test_exploded_walks.py"),
            f"{WALKS} or insect or replay",
        ),
    ),
    "measurement": (
        Module("physics/outcomes.py", (MEASURING, "tests/test_physical_laws.py", "tests/test_physics.py"), MEASURES),
        Module("physics/measured.py", (MEASURING, "tests/test_physical_laws.py", "tests/test_physics.py"), MEASURES),
        Module("physics/sensing.py", (MEASURING, "tests/test_closed_loop.py", "tests/test_physics.py"), FELT),
    ),
}

BINARY = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "/", ast.Mod: "*", ast.Pow: "*",
    ast.BitAnd: "|", ast.BitOr: "&", ast.MatMult: "*",
}  # fmt: skip
COMPARED = {
    ast.Lt: ("<=", ">"), ast.LtE: ("<", ">="), ast.Gt: (">=", "<"), ast.GtE: (">", "<="), ast.Eq: ("!=",),
    ast.NotEq: ("==",), ast.Is: ("is not",), ast.IsNot: ("is",), ast.In: ("not in",), ast.NotIn: ("in",),
}  # fmt: skip
SYMBOLS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
    ast.BitAnd: "&", ast.BitOr: "|", ast.MatMult: "@", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is", ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in",
    ast.And: "and", ast.Or: "or", ast.Not: "not", ast.Invert: "~", ast.USub: "-",
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One fault."""

    module: Module
    begin: int
    """Where in the source it begins, in characters."""
    end: int
    instead: str

    @property
    def source(self) -> str:
        """Of the module with the fault."""
        return self.module.text[: self.begin] + self.instead + self.module.text[self.end :]

    def __str__(self) -> str:
        line = self.module.text.count("\n", 0, self.begin)
        return f"{self.module.path}:{line + 1}  {self.source.splitlines()[line].strip()}"


def mutants(module: Module) -> list[Mutant]:
    """All of a module, in the order of its source."""
    text, lines = module.text, [0]
    for line in text.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))

    def at(node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return lines[node.lineno - 1] + node.col_offset, lines[node.end_lineno - 1] + node.end_col_offset

    def between(left: ast.expr, right: ast.expr, symbol: str, instead: str) -> Mutant:
        begin = text.index(symbol, at(left)[1], at(right)[0])
        return Mutant(module, begin, begin + len(symbol), instead)

    def faults(node: ast.AST) -> Iterator[Mutant]:
        match node:
            case ast.BinOp(left, op, right):
                yield between(left, right, SYMBOLS[type(op)], BINARY[type(op)])
            case ast.AugAssign(target, op, value):
                yield between(target, value, SYMBOLS[type(op)] + "=", BINARY[type(op)] + "=")
            case ast.UnaryOp(op):
                begin, _ = at(node)
                yield Mutant(module, begin, begin + len(SYMBOLS[type(op)]), "")
            case ast.BoolOp(op, values):
                word, instead = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
                yield from (between(one, other, word, instead) for one, other in pairwise(values))
            case ast.Compare(left, ops, rights):
                for op, (one, other) in zip(ops, pairwise([left, *rights]), strict=True):
                    yield from (between(one, other, SYMBOLS[type(op)], instead) for instead in COMPARED[type(op)])
            case ast.Constant(bool() as value):
                yield Mutant(module, *at(node), str(not value))
            case ast.Constant(int() | float() as value):
                yield from (Mutant(module, *at(node), repr(value + by)) for by in (1, -1))
            case ast.Break() | ast.Continue():
                yield Mutant(module, *at(node), "continue" if isinstance(node, ast.Break) else "break")
            case ast.If(test) | ast.IfExp(test) | ast.While(test):
                begin, end = at(test)
                yield Mutant(module, begin, end, f"(not ({text[begin:end]}))")

    found = {one for node in _computing(ast.parse(text)) for one in faults(node)}
    return sorted(found, key=lambda one: (one.begin, one.end, one.instead))


def _computing(node: ast.AST) -> Iterator[ast.AST]:
    """A node and everything below it but types and decorators."""
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ("annotation", "returns", "decorator_list"):
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, ast.AST):
                    yield from _computing(one)


def is_killed(folder: Path, module: Module, source: str) -> bool:
    """Whether the module's tests fail in a copy of the project that holds this source of it."""
    path = folder / "hexmj" / module.path
    original = path.read_bytes()
    path.write_text(source.replace(*module.replaced) if module.replaced[0] else source, "ascii")
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {} if module.compiled else {"NUMBA_DISABLE_JIT": "1"}
    words = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", *module.tests]
    words += ["-k", module.chosen] if module.chosen else []
    try:
        tests = subprocess.run(words, cwd=folder, env=environment, timeout=SECONDS, stdin=DEVNULL, capture_output=True)
        return tests.returncode != 0
    except subprocess.TimeoutExpired:
        return True
    finally:
        path.write_bytes(original)


def copy(folder: Path) -> Path:
    """The project as the mutants meet it."""
    for name in COPIED:
        one = ROOT / name
        (shutil.copytree if one.is_dir() else shutil.copy2)(one, folder / name)
    with (folder / "tests/conftest.py").open("a") as conftest:
        conftest.write(CONFTEST)
    return folder


def try_group(name: str, sample: int, seed: int, only: list[str], processes: int) -> None:
    """Print how each mutant of a sample went, and what share was killed."""
    every = [one for module in GROUPS[name] for one in mutants(module)]
    drawn = random.Random(seed).sample(every, min(sample, len(every)))
    drawn = [one for one in drawn if any(text in str(one) for text in only or [""])]
    killed, folders = 0, Queue[Path]()
    with TemporaryDirectory() as temporary, ThreadPoolExecutor(processes) as workers:
        for number in range(processes):
            (folder := Path(temporary) / str(number)).mkdir()
            folders.put(copy(folder))

        def tried(module: Module, source: str) -> bool:
            folder = folders.get()
            try:
                return is_killed(folder, module, source)
            finally:
                folders.put(folder)

        for module in {one.module for one in drawn}:
            if tried(module, module.text):
                sys.exit(f"{module.path}: the tests fail without a mutant")
        jobs = workers.map(tried, [one.module for one in drawn], [one.source for one in drawn])
        for one, noticed in zip(drawn, jobs, strict=True):
            killed += noticed
            print("killed  " if noticed else "SURVIVED", one, flush=True)
    low, high = wilson_interval(killed, len(drawn))
    print(f"{name}: {killed} of {len(drawn)} killed ({low:.2f}-{high:.2f}), drawn from {len(every)}", flush=True)


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("groups", nargs="*", default=list(GROUPS), help=f"of {', '.join(GROUPS)}")
    parser.add_argument("--sample", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[], help="those of the sample whose file, line or text has one of")
    parser.add_argument("--processes", type=int, default=2)
    told = parser.parse_args()
    for name in told.groups:
        try_group(name, told.sample, told.seed, told.only, told.processes)


if __name__ == "__main__":
    main()
