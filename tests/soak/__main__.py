"""`python -m tests.soak INPUTS`: that many inputs, half of them command lines; says what went wrong, and with what.

Each worker draws from a seed of its own.  Exit code 1 if there is a fault.
"""

import json
import sys
import time
from argparse import ArgumentParser
from collections import Counter
from multiprocessing import get_context
from pathlib import Path

from tests.soak.drawn import KINDS, try_job

SHARES = {"commands": 0.5, "calls": 0.3, "files": 0.2}
CHUNK = 500
"""Inputs of a worker before it starts anew."""


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("inputs", type=int, nargs="?", default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=tuple(KINDS), default=None, help="only these")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/soak.json"))
    told = parser.parse_args()
    shares = {told.kind: 1.0} if told.kind else SHARES
    jobs = [
        (kind, CHUNK, told.seed + number)
        for kind, share in shares.items()
        for number in range(max(1, round(told.inputs * share / CHUNK)))
    ]
    began, faults, codes = time.monotonic(), {}, {kind: Counter() for kind in shares}
    with get_context("spawn").Pool(told.processes, maxtasksperchild=4) as workers:  # an executor may hang at a new one
        for done, tried in enumerate(workers.imap_unordered(try_job, jobs), 1):
            codes[tried.kind].update(tried.codes)
            for fault, example in tried.faults.items():
                if (tried.kind, fault) not in faults:
                    print(f"{tried.kind}: {fault}\n    {example}", flush=True)
                faults.setdefault((tried.kind, fault), [example, 0])[1] += 1
            _tell(done, len(jobs), time.monotonic() - began)
    summary = {
        "inputs": {kind: counter.total() for kind, counter in codes.items()},
        "exit codes": {kind: {str(code): n for code, n in sorted(counter.items())} for kind, counter in codes.items()},
        "faults": [{"kind": kind, "fault": fault, "example": one} for (kind, fault), (one, _) in faults.items()],
        "minutes": round((time.monotonic() - began) / 60, 1),
    }
    told.out.parent.mkdir(parents=True, exist_ok=True)
    told.out.write_text(json.dumps(summary, indent=2) + "\n")
    print(json.dumps(summary | {"faults": len(faults)}))
    sys.exit(bool(faults))


def _tell(done: int, jobs: int, seconds: float) -> None:
    print(f"\r{done} of {jobs} jobs, {seconds / 60:.1f} minutes", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
