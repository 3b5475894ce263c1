"""The command `hexmj`, also as `python -m hexmj`: it can be stopped from its first moment on."""

import gc
import os
import sys
from contextlib import suppress

from hexmj.process.signals import hear_stops, ignore_stops, of_stop


def main() -> None:
    """Run the command line; Ctrl-C, SIGTERM and a terminal that closes stop it, exit code 130.

    Once all is said they change nothing: the interpreter may take a moment to end.
    """
    if sys.stderr is None:  # it was closed, and print would take standard output instead
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    try:
        hear_stops()
        gc.set_threshold(10_000)  # after so many new objects: `hexmj flss` takes 5 % less time
        from hexmj.cli.main import main as command

        command()
        ignore_stops()
    except BaseException as error:
        ignore_stops()
        if not of_stop(error):
            raise
        if not (isinstance(error, SystemExit) and error.code == 130):  # that one is told already
            print("hexmj: stopped", file=sys.stderr, flush=True)
        if util := sys.modules.get("multiprocessing.util"):
            with suppress(Exception):
                util._run_finalizers(0)  # semaphores; somebody would be told that they leaked
        os._exit(130)  # half-imported modules may not survive the interpreter's own end


if __name__ == "__main__":
    main()
