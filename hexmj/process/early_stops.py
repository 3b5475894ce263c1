"""Stops that reach the command before it hears them: nothing is begun, so it says so and ends at once."""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from hexmj.process.signals import STOPS


def _end(number: int, frame: Any) -> None:
    with suppress(OSError):
        os.write(2, b"hexmj: stopped\n")
    os._exit(130)


def _is_the_command() -> bool:
    """Whether this program was started as `hexmj` or `python -m hexmj`; no process of a pool was."""
    now, began = sys.argv[:1], sys.orig_argv[-len(sys.argv) :][:1]
    return (now == ["-m"] and began in (["hexmj"], ["-mhexmj"])) or (now == began and Path(*now).stem == "hexmj")


if _is_the_command():
    for one in STOPS:
        if signal.getsignal(one) != signal.SIG_IGN:
            signal.signal(one, _end)
