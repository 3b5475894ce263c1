"""`python -m tests.soak.crashes ROUNDS`: jobs killed at that many random moments, and each gone on with.

Exit code 1 if anything was lost, computed twice, half written or other than what an unbroken run gives.
"""

import json
import os
import re
import subprocess
import sys
import time
from argparse import ArgumentParser
from collections import Counter
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from hexmj.storage.files import PART, read_sealed
from tests.soak.faults import ERRORS, LEFT
from tests.soak.jobs import JOBS, SIZES, noted

CODES = {
    **{kind: (2,) for kind in ERRORS},
    "short": (0,),
    "exit": (LEFT,),
    "kill": (-9,),
    "moment": (0, -9),
    "end": (0,),
}
"""Exit codes that are right, by what happened."""

SENTENCE = re.compile(r"hexmj: \S.* cannot be written( to)?: \S")


class Nursery:
    """Where jobs are done in processes that may be killed, and what is asked of them."""

    def __init__(self, folder: Path) -> None:
        paths = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.nursery"],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._folder, self._numbers = folder, count()
        self._unbroken: dict[str, Life] = {}

    def close(self) -> None:
        """No more lives."""
        self._process.communicate()

    def life(self, job: str, folder: Path | None = None, **task: Any) -> "Life":
        """A job, done in a new folder or gone on with."""
        assert self._process.stdin and self._process.stdout
        number = next(self._numbers)
        folder, log = folder or self._folder / f"{number}", self._folder / f"{number}.log"
        task |= {"job": job, "folder": str(folder), "log": str(log), "fault": task.get("fault")}
        self._process.stdin.write(json.dumps(task) + "\n")
        self._process.stdin.flush()
        return Life(job, folder, log, **json.loads(self._process.stdout.readline()))

    def unbroken(self, job: str) -> "Life":
        """A job's life without a fault."""
        if job not in self._unbroken:
            self._unbroken[job] = whole = self.life(job)
            assert (whole.code, whole.told.strip()) == (0, ""), whole.told
        return self._unbroken[job]

    def points(self, job: str, kind: str) -> list[int]:
        """Which calls of a job's unbroken life may go wrong in this way: all, but only a write can be short."""
        told = json.loads(Path(f"{self.unbroken(job).log}.calls").read_text())
        return told["writes"] if kind == "short" else [*range(told["calls"])]

    def broken(self, job: str, *ends: dict[str, Any]) -> list[str]:
        """What is amiss where a job ends in these ways, one after the other, and then comes to its end.

        Args:
            job: its name.
            ends: each has a `fault`, see `faults.Disk`, or the `moment` [s] of a SIGKILL.
        """
        whole, life, faults = self.unbroken(job), None, list[str]()
        for end in (*ends, {}):
            kept, before = (life.kept(), life.files()) if life else (set[str](), {})
            life = self.life(job, life and life.folder, **end)
            faults += [*life.ended(end), *life.went_on(whole, kept, before)]
        assert life
        return faults if faults or life.code else life.other_than(whole)


class Life:
    """How a job ended, and what it left."""

    def __init__(self, job: str, folder: Path, log: Path, code: int, told: str, lived: float) -> None:
        self.job, self.folder, self.code, self.lived = job, folder, code, lived
        self.told = "".join(line for line in told.splitlines(keepends=True) if "% in " not in line)  # but progress
        self.log, self.notes = log, noted(log)

    def key(self, line: str) -> str:
        """Of what a note tells: the velocity of a cell, or size and parameter of an evaluation."""
        return line.split()["search" in self.job]

    def computed(self) -> Counter[str]:
        """How often each was begun."""
        found = Counter[str]()
        for line, times in self.notes.items():
            found[self.key(line)] += times
        return found

    def files(self) -> dict[str, tuple[int, int]]:
        """Each with its identity and when it was written."""
        return {
            str(path.relative_to(self.folder)): ((told := path.stat()).st_ino, told.st_mtime_ns)
            for path in self.folder.rglob("*")
            if path.is_file()
        }

    def kept(self) -> set[str]:
        """What a further run need not compute."""
        cells = {path.name.rpartition("-")[0] for path in self.folder.glob("walks/[!.]*.nc")}
        found = {f"V-{cell.rpartition('V-')[2]}" for cell in cells}
        for stage, size in SIZES.items():
            for path in self.folder.glob(f"evaluations/{stage}-*.jsonl"):
                lines = [line.split(" ") for line in path.read_text(errors="replace").split("\n")[1:]]
                found |= {f"{size}-{one[0]}" for one in lines if len(one) == 3 and len(one[2]) == 8}
        return found

    def ended(self, end: dict[str, Any]) -> list[str]:
        """Faults of its end: a traceback, more or less than one sentence, something half written or left behind."""
        kind = end["fault"]["kind"] if "fault" in end else "moment" if end else "end"
        lines = self.told.strip().splitlines()
        parts = [name for name in self.files() if PART in name]
        faults = {
            f"exit code {self.code} after {kind}: {self.told[-300:]}": self.code not in CODES[kind],
            f"no sentence: {self.told[-300:]}": self.code == 2 and not (len(lines) == 1 and SENTENCE.match(lines[0])),
            f"left behind: {parts}": self.code in (0, 2) and bool(parts),
        }
        half = [f"half written: {path}" for path in self.folder.rglob("[!.]*.nc") if read_sealed(path) is None]
        return [fault for fault, true in faults.items() if true] + half

    def went_on(self, whole: "Life", kept: set[str], before: dict[str, tuple[int, int]]) -> list[str]:
        """Faults of what it computed and kept: lost, computed twice, written again.

        Args:
            whole: an unbroken life.
            kept: what needed no computation when it began.
            before: files that were there.
        """
        computed, after, now = self.computed(), self.files(), self.kept()
        missing = whole.computed().keys() - kept
        faults = [f"lost: {sorted(gone)}"] if len(gone := computed.keys() - now) > JOBS[self.job].flight else []
        faults += [f"lost: {key}" for key in kept - now]
        faults += [f"computed again: {key}" for key in computed if key in kept]
        faults += [f"not computed: {key}" for key in missing if self.code == 0 and key not in computed]
        faults += [f"computed twice: {key}" for key in computed if computed[key] > whole.computed()[key]]
        cells = {name for name in before if name.startswith("walks/") and PART not in name}
        return faults + [f"written again: {name}" for name in cells if after.get(name) != before[name]]

    def other_than(self, whole: "Life") -> list[str]:
        """Where its result has other bits than that of an unbroken life."""
        (mine, other) = (result(one.folder) for one in (self, whole))
        same = mine.identical(other) and all(
            np.array_equal(mine[name].values.view(np.uint8), other[name].values.view(np.uint8))
            for name in other.variables
            if other[name].dtype.kind in "fiu" and other[name].ndim
        )
        return [] if same else ["the result has other bits"]


def result(folder: Path) -> xr.Dataset:
    """Of a job."""
    (path,) = [*folder.glob("result.nc"), *folder.glob("comparison.nc")]
    return xr.load_dataset(path, engine="h5netcdf")


KILLED = [name for name in JOBS if name != "killed process"]


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("rounds", type=int, nargs="?", default=200)
    parser.add_argument("--seed", type=int, default=0)
    told = parser.parse_args()
    draw, found, began = np.random.default_rng(told.seed), Counter[str](), time.monotonic()
    with TemporaryDirectory() as folder:
        nursery = Nursery(Path(folder))
        for number in range(told.rounds):
            job = KILLED[number % len(KILLED)]
            moments = draw.uniform(0, nursery.unbroken(job).lived, size=draw.integers(1, 4))
            faults = nursery.broken(job, *({"moment": moment} for moment in moments))
            found["kills"] += len(moments)
            found["bad"] += bool(faults)
            for fault in faults:
                print(f"{job} killed at {moments.round(3).tolist()} s: {fault}", flush=True)
        nursery.close()
    print(json.dumps({"rounds": told.rounds, **found, "minutes": round((time.monotonic() - began) / 60, 1)}))
    sys.exit(bool(found["bad"]))


if __name__ == "__main__":
    main()
