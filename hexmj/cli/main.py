"""The command line: words in, one call to the package, and every error as one sentence with its exit code."""

import errno
import os
import shlex
import sys
from contextlib import nullcontext, redirect_stdout, suppress
from io import StringIO, TextIOWrapper
from pathlib import Path
from typing import Any

from hexmj.cli import answer_stream
from hexmj.cli.command_words import checked, typed
from hexmj.cli.commands import COMMANDS, GOES_ON, options_of
from hexmj.cli.surroundings import GONE, has_gone, settle, untold
from hexmj.errors import InputError, RenderingError, SimulationError, is_of_numbas_cache
from hexmj.process.signals import of_stop
from hexmj.storage.literal import literal

NUMBA = (
    "numba cannot find or keep compiled code; delete its files (*.nbi, *.nbc, beside the modules or in"
    " NUMBA_CACHE_DIR), or set NUMBA_CACHE_DIR to a folder that can be written to"
)

MEMORY = "the memory does not suffice ({}); expected more of it, or fewer starts"

DOCTOR = "doctor"
"""Tells what is amiss by itself."""

OUTPUT = "standard output"
SHORT = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN}
"""What the system has too little of, where no file is named."""


def main() -> None:
    """The command `hexmj`: exit code 2 for input that makes no sense, 1 for a simulation that failed."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # neither closed nor replaced
            stream.reconfigure(errors="backslashreplace")
    sys.path.append("")  # for modules of the user's own in the current folder, as `python -m hexmj` finds them
    options: Any = None
    try:
        try:
            settle()
            with nullcontext() if sys.stdout else redirect_stdout(StringIO()):  # tyro asks it how wide it is
                options = options_of(words := checked(sys.argv[1:]))
            if words[0] in COMMANDS and words[0] != DOCTOR and (told := untold()):
                raise InputError(told)
            with typed(words), answer_stream.alone() if getattr(options, "json", False) else nullcontext():
                options.run()
        except BaseException as error:
            if of_stop(error):
                raise KeyboardInterrupt from None
            raise
        finally:
            if sys.stdout:  # there is none where it was closed
                sys.stdout.flush()
    except KeyboardInterrupt:
        goes_on = getattr(options, "out", None) and GOES_ON in COMMANDS.get(sys.argv[1], "")
        kept = f"; what is finished is kept. {GOES_ON}" if goes_on else ""
        sys.exit(_complain(f"stopped{kept}", 130))
    except InputError as error:
        sys.exit(_complain(error, 2))
    except SimulationError as error:
        sys.exit(_complain(f"{error}{_kept(error, getattr(options, 'out', None))}", 1))
    except RenderingError as error:
        sys.exit(_complain(error, 1))
    except MemoryError as error:
        sys.exit(_complain(MEMORY.format(str(error) or "nothing is left"), 2))
    except BrokenPipeError:  # whoever read the output has gone, as `head` does
        _drop_output()
        sys.exit(141)
    except OSError as error:
        if is_of_numbas_cache(error):
            sys.exit(_complain(f"{NUMBA} ({error.strerror or error})", 2))
        if not error.filename and has_gone():
            sys.exit(_complain(GONE, 2))
        where = error.filename or ("the system" if error.errno in (None, *SHORT) else OUTPUT)
        if where == OUTPUT:
            _drop_output()
        sys.exit(_complain(f"{where}: {error.strerror or error}", 2))
    except Exception as error:
        if "can't start new thread" in str(error):
            sys.exit(_complain("the memory, or a limit of processes, does not suffice for a thread", 2))
        if "Could not allocate memory" in str(error):  # MuJoCo's
            sys.exit(_complain(MEMORY.format(error), 2))
        if not is_of_numbas_cache(error):
            raise
        sys.exit(_complain(f"{NUMBA} ({type(error).__name__}: {error})", 2))


def _kept(error: SimulationError, out: Path | None) -> str:
    """Where the last good state of a simulation that failed is kept, as the end of a sentence."""
    if not error.state:
        return ""
    if out is None:
        return "; give --out to keep its last good state there"
    from hexmj.physics.divergence import save_state

    try:
        path = save_state(error, out)
        again = shlex.join(["python", "-m", "hexmj.physics.divergence", str(path)])
        return f"; its last good state is in {path}; {again} replays it"
    except InputError as problem:
        return f"; its last good state is lost: {problem}"


def _drop_output() -> None:
    """Nothing more is written to standard output, nor tried at the end of the program."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(error: Exception | str, code: int) -> int:
    with suppress(OSError):
        print(f"hexmj: {literal(str(error))}", file=sys.stderr, flush=True)
    return code
