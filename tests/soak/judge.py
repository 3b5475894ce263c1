"""One input in a process of its own, with an end to its time and memory, and what is wrong with how it went."""

import os
import re
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import current_process
from pathlib import Path

SECONDS = 60.0
"""Longer than any input that is drawn takes on a busy machine; what is still running then hangs."""

MEMORY = 8 << 30
"""Address space [bytes]."""

CODES = (0, 1, 2)
"""Exit codes: it is done, a simulation failed or a check said no, or the input made no sense."""

LONGEST = 3000
"""Characters of a complaint; longer ones echo what they were given."""

TRACEBACK = 70
"""Exit code for an exception that nobody expected."""


@dataclass(frozen=True)
class Verdict:
    """How an input went."""

    code: int
    complaint: str
    """What was written to standard error."""
    seconds: float
    faults: tuple[str, ...]
    """What is wrong with that, each in a few words."""


def judged(work: Callable[[], None], folder: Path) -> Verdict:
    """Do `work` in a forked process whose current folder is `folder`, and look at what it said and left there."""
    before, began = _files(folder), time.monotonic()
    child = os.fork()
    if not child:
        _do(work, folder)
    status = _wait(child, began + SECONDS)
    seconds = time.monotonic() - began
    out, complaint = ((folder / name).read_text("utf-8", "backslashreplace") for name in (".stdout", ".stderr"))
    left = _files(folder) - before
    if status is None:
        return Verdict(-signal.SIGKILL, complaint, seconds, (f"no end after {SECONDS:g} s",))
    code = os.waitstatus_to_exitcode(status)
    faults = [f"ended by signal {-code}"] if code < 0 else []
    faults += [complaint.strip().splitlines()[-1][:200]] if code == TRACEBACK else []
    faults += [f"exit code {code}"] if code >= 0 and code not in (*CODES, TRACEBACK) else []
    faults += ["a traceback is printed"] if code != TRACEBACK and "Traceback (most" in complaint else []
    faults += [f"{len(complaint)} characters of complaint"] if code != TRACEBACK and len(complaint) > LONGEST else []
    faults += ["control characters are printed"] if re.search(r"[\x00-\x08\x0b-\x1f\x7f\x9b]", out + complaint) else []
    faults += ["no complaint"] if code == 2 and not complaint.strip() else []
    faults += [f"left {sorted(left)[0]}"] if code == 2 and left else []
    faults += ["left a part of a file"] if any(Path(name).name.startswith(".part-") for name in left) else []
    return Verdict(code, complaint, seconds, tuple(faults))


def _do(work: Callable[[], None], folder: Path) -> None:
    code = TRACEBACK
    try:
        current_process()._config["daemon"] = False  # pyright: ignore  # as its parent is, which may have no children
        os.chdir(folder)
        for number, name in ((1, ".stdout"), (2, ".stderr")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (open(number, "w", closefd=False) for number in (1, 2))  # noqa: SIM115
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        work()
        code = 0
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
    except BaseException:  # what an input may raise is what is looked for
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)


def _wait(child: int, end: float) -> int | None:
    """The status with which it ended; None where it had to be killed."""
    pause = 0.001
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status
        time.sleep(pause)
        pause = min(2 * pause, 0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _files(folder: Path) -> set[str]:
    found = (path for path in folder.rglob("*") if not path.is_dir())
    return {str(path.relative_to(folder)) for path in found} - {".stdout", ".stderr"}
