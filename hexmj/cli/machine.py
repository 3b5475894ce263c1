"""`hexmj doctor` and `hexmj rerun`."""

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

from hexmj.cli.command import Command
from hexmj.cli.options import Json
from hexmj.cli.output import report_checks, show
from hexmj.errors import InputError


class Doctor(Command):
    """List the versions of packages, and check films and a short walk. A failed check shows its error, and a remedy if
    the cause is known; the exit code is then 1."""

    sources = (Json,)
    examples = ("", "--json")

    def run(self, given: SimpleNamespace) -> None:
        report_checks(examine(), given.json)


def examine() -> Iterator[SimpleNamespace]:
    """Run every check and yield its finding; the last line of the error of a failed check becomes the finding."""
    for check in CHECKS:
        try:
            yield SimpleNamespace(name=check.__name__, well=True, found=check())
        except Exception as error:
            found = (str(error) or repr(error)).splitlines()[-1]
            remedies = (f"{found} Remedy: {remedy}" for words, remedy in REMEDIES.items() if words in str(error))
            yield SimpleNamespace(name=check.__name__, well=False, found=next(remedies, found))


def versions() -> str:
    """Return the versions of hexmj, Python and the main packages."""
    from hexmj.io import versions

    return ", ".join(f"{name} {number}" for name, number in versions().items())


def films() -> str:
    """Check that MuJoCo renders frames and ffmpeg encodes them."""
    from hexmj.conditions import Conditions
    from hexmj.controllers.cruse1998 import LDVS
    from hexmj.measures.kinematic import walk
    from hexmj.replay.recording import record_plan
    from hexmj.replay.video import Film, render
    from hexmj.starts import draw_starts
    from hexmj.timing import Stride

    plan = record_plan(walk(draw_starts(1, 0), LDVS, 0.1, 5.0), Conditions(), Stride())
    with tempfile.TemporaryDirectory() as folder:
        frames = render([plan], Path(folder) / "film.mp4", Film(width=64, height=64))
    return f"a film of {frames} frames with MUJOCO_GL={os.environ.get('MUJOCO_GL', '')}"


def walking() -> str:
    """Check that two insects walk without a fall, and that one thread and all threads compute the same bits."""
    import numpy as np

    from hexmj.controllers.cruse1998 import LDVS
    from hexmj.measures.physical import physical_walk
    from hexmj.starts import draw_starts

    single, several = (physical_walk(draw_starts(2, 0), LDVS, 0.1, 20.0, threads=n) for n in (1, None))
    if np.isfinite(single.outcomes.fall).any():
        raise RuntimeError("an insect fell in a walk in which no insect falls on other machines")
    if not np.array_equal(single.qpos, several.qpos):
        raise RuntimeError("the same walk differs between one thread and several threads")
    return "two insects walked for 20 time units, with the same bits on one thread and on all"


CHECKS: tuple[Callable[[], str], ...] = (versions, films, walking)

REMEDIES = {  # words of an error -> what to do; the first words that match count
    "cannot cache": "Set NUMBA_CACHE_DIR to a writable folder.",
    "MUJOCO_GL: ": "Set MUJOCO_GL=egl.",
    "ffmpeg": "Unset IMAGEIO_FFMPEG_EXE, or reinstall imageio-ffmpeg; only films need it.",
}


@dataclass(frozen=True)
class RerunOptions:
    """Options of `hexmj rerun`."""

    result: Path
    """Folder with the results of a command. Relative paths in that command, such as mine.py, are read from the current
    directory."""


class Rerun(Command):
    """Repeat the command that a manifest records, in a temporary folder, and compare all numbers bit for bit. Package
    versions that have changed are listed. The exit code is 1 if a number differs."""

    sources = (RerunOptions, Json)
    positional = "result"
    examples = ("results/compare", "results/flss --json")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.cli.main import run
        from hexmj.io import MANIFEST, json_text

        then = json.loads((given.result / MANIFEST).read_text(encoding="utf-8"))
        names = [name for name in then["files"] if name.endswith(".nc")]
        if not names:
            raise InputError(f"{given.result / MANIFEST} lists no NetCDF file; only NetCDF files can be compared")
        with tempfile.TemporaryDirectory(prefix="hexmj-rerun-") as folder:
            with redirect_stdout(StringIO()):
                run([*then["command"], "--out", folder])
            files = {name: _difference(given.result / name, Path(folder) / name) for name in names}
            now = json.loads((Path(folder) / MANIFEST).read_text(encoding="utf-8"))
        pairs = {name: [then["versions"].get(name), version] for name, version in now["versions"].items()}
        versions = {name: [old, new] for name, (old, new) in pairs.items() if old != new}
        equal = not any(files.values())
        if given.json:
            print(json_text({"equal": equal, "command": then["command"], "differences": files, "versions": versions}))
        else:
            show(*(f"{name}: {text or 'all bits are equal'}" for name, text in files.items()))
            show(*(f"version of {name}: {old} in the manifest, {new} now" for name, (old, new) in versions.items()))
        sys.exit(0 if equal else 1)


def _difference(then: Path, now: Path) -> str:
    """Return the differences between two NetCDF files as a text, or "" if there are none."""
    import xarray as xr

    from hexmj.files import read_netcdf

    try:
        xr.testing.assert_identical(read_netcdf(then), read_netcdf(now))
    except AssertionError as error:
        return str(error)
    return ""
