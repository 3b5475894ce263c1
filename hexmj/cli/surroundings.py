"""What a command finds around it, settled before libraries read it that would make a traceback of it."""

import os
import shutil

from hexmj.errors import InputError
from hexmj.replay.film.gl import drop_vain_wish

NARROWEST = 40
"""Columns of a terminal; in a few, boxes of help are never done."""


def settle() -> None:
    """Settle the folder, the terminal's width, threads of numba, and where figures and frames are drawn.

    Raises:
        InputError: the current folder has gone, or numba's number of threads is none.
    """
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError("the current folder is no longer there; expected one that is") from None
    columns = shutil.get_terminal_size().columns
    if columns < NARROWEST or "COLUMNS" in os.environ:  # as 0, of which Python makes 80, and other libraries nothing
        os.environ["COLUMNS"] = str(max(columns, NARROWEST))
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    if not (threads.isdecimal() and int(threads) > 0):
        raise InputError(f"NUMBA_NUM_THREADS = {threads:.80}; expected a whole number of at least 1, or nothing")
    os.environ["MPLBACKEND"] = "agg"  # figures go to files
    drop_vain_wish()
