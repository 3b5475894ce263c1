"""The command `hexmj`, also as `python -m hexmj`: it can be stopped from its first moment on."""

import os
import signal
import sys
from threading import Timer
from typing import Any

STOPS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
"""What stops the command."""

_HEARD: list[int] = []


def main() -> None:
    """Run the command line; Ctrl-C, SIGTERM and a terminal that closes stop it, exit code 130."""
    sys.unraisablehook = _unheard
    try:
        for one in STOPS:
            if signal.getsignal(one) != signal.SIG_IGN:  # as `nohup` has it
                signal.signal(one, _stop)
        from hexmj.cli.main import main as command

        command()
    except (KeyboardInterrupt, ImportError, SystemExit) as error:
        told = isinstance(error, SystemExit)
        if not _HEARD or (told and error.code != 130):
            raise
        for one in STOPS:
            signal.signal(one, signal.SIG_IGN)
        if not told:
            print("hexmj: stopped", file=sys.stderr, flush=True)
        os._exit(130)  # half-imported modules, or one more Ctrl-C, may not survive the interpreter's own end


def _stop(number: int, frame: Any) -> None:
    """As Ctrl-C does; some modules make an ImportError of it while they are imported."""
    _HEARD.append(number)
    raise KeyboardInterrupt


def _unheard(ignored: Any) -> None:
    """A stop that C code swallows, as while numba loads what it has compiled, comes once more."""
    if _HEARD and ignored.exc_type is KeyboardInterrupt:
        Timer(0.1, os.kill, (os.getpid(), _HEARD[-1])).start()
    else:
        sys.__unraisablehook__(ignored)


if __name__ == "__main__":
    main()
