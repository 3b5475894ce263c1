"""A process that has imported everything, and brings up one short life after another: `python -m tests.soak.nursery`.

A line of JSON on standard input is a task; one on standard output says how it ended.
"""

import io
import json
import os
import signal
import sys
import time
import traceback
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.soak.counted import LOG
from tests.soak.faults import Disk


def live(job: str, folder: str, log: str, fault: dict[str, Any] | None) -> int:
    """Do a job to its end, with a fault if one is given; the exit code of a command."""
    from hexmj.errors import InputError
    from tests.soak.jobs import JOBS

    os.environ[LOG] = log
    disk = Disk(Path(folder), **(fault or {}))
    disk.install()
    try:
        JOBS[job].work(Path(folder))
        Path(f"{log}.calls").write_text(json.dumps({"calls": disk.calls, "writes": disk.writes}))
    except InputError as error:
        print(f"hexmj: {error}", file=sys.stderr)
        return 2
    except SystemExit as stop:
        return int(stop.code or 0)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def born(task: dict[str, Any]) -> dict[str, Any]:
    """A life in a group of its own, all of which ends when it does, or at a moment [s]; its exit code and errors."""
    moment, told = task.pop("moment", None), Path(task["log"] + ".told")
    told.touch()
    began = time.monotonic()
    if (child := os.fork()) == 0:
        os.setsid()
        with told.open("w") as file, open(os.devnull, "w") as printed, redirect_stderr(file), redirect_stdout(printed):
            code = live(**task)
        os._exit(code)
    if moment is not None:
        time.sleep(moment)
        for end in (os.killpg, os.kill):
            with suppress(ProcessLookupError):
                end(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    lived = time.monotonic() - began
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return {"code": os.waitstatus_to_exitcode(status), "told": told.read_text(), "lived": lived}


def main() -> None:
    """Whatever is asked for; a job is done here once before, so that its sources are known."""
    from tests.soak.jobs import JOBS  # not by processes of a pool, which import this module too

    known = set[str]()
    for line in sys.stdin:
        task = json.loads(line)
        job = JOBS[task["job"]].like or task["job"]
        if job not in known:
            with TemporaryDirectory() as folder:
                os.environ[LOG] = f"{folder}/log"
                with redirect_stdout(io.StringIO()):
                    JOBS[job].work(Path(folder))
            known.add(job)
        print(json.dumps(born(task)), flush=True)


if __name__ == "__main__":
    main()
