"""What a command finds around it, settled before libraries read it that would make a traceback of it."""

import os
import shutil
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hexmj.errors import InputError
from hexmj.rendering.gl import drop_vain_wish
from hexmj.storage.literal import literal

NARROWEST = 40
"""Columns of a terminal; in a few, boxes of help are never done."""

GONE = "the current folder is no longer there; expected one that is"

_NUMBERS = {"NUMBA_NUM_THREADS": (1, 2**31 - 1), "SOURCE_DATE_EPOCH": (0, 253_402_300_799)}
"""Variables of the environment -> least and most that libraries take: threads; seconds to the end of the year 9999."""

PROCESSES = Path("/proc")
"""Where Linux tells of processes; nothing is there elsewhere, where nobody asks for it."""

_PACKAGE = Path(__file__).parents[1]
_USUAL = warnings.formatwarning


def settle() -> None:
    """Settle the folder, the terminal's width, numbers for libraries, how warnings of this package are shown, and where
    figures and frames are drawn.

    Raises:
        InputError: the current folder has gone, or one of the numbers is none.
    """
    if has_gone():
        raise InputError(GONE)
    columns = shutil.get_terminal_size().columns
    if columns < NARROWEST or "COLUMNS" in os.environ:  # as 0, of which Python makes 80, and other libraries nothing
        os.environ["COLUMNS"] = str(max(columns, NARROWEST))
    for name, (least, most) in _NUMBERS.items():
        if os.environ.get(name) == "":
            del os.environ[name]
        number = os.environ.get(name, str(least))
        if not (number.isdecimal() and least <= int(number[:20]) <= most):
            raise InputError(f"{name} = {number:.80}; expected a whole number from {least} to {most}, or nothing")
    warnings.formatwarning = _shown
    os.environ["MPLBACKEND"] = "agg"  # figures go to files
    drop_vain_wish()
    _spare_glfw_its_programs()


def has_gone() -> bool:
    """Whether the current folder was removed."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def untold() -> str:
    """In one sentence, that nothing tells of this process where Dask, which xarray imports, asks; else nothing."""
    told = sys.platform != "linux" or (PROCESSES / str(os.getpid())).exists()
    if told or not all(map(find_spec, ("dask", "psutil"))):
        return ""
    return f"{PROCESSES} does not tell of this process; expected that it does, for Dask asks for its cores"


def _spare_glfw_its_programs() -> None:
    """GLFW, which MuJoCo imports, starts a program for each library that it finds, to ask for its version; and Ctrl-C
    reaches that, too.  It may take its own, of the kind that it would look for first."""
    spec, session = find_spec("glfw"), os.environ.get("XDG_SESSION_TYPE")
    wish = os.environ.get("PYGLFW_LIBRARY_VARIANT", "").lower()
    kind = wish if wish in ("wayland", "x11") else "wayland" if session == "wayland" else "x11"
    for folder in (spec and spec.submodule_search_locations) or ():
        if (own := Path(folder, kind, "libglfw.so")).is_file():
            os.environ.setdefault("PYGLFW_LIBRARY", str(own))


def _shown(message: Warning | str, category: type[Warning], filename: str, *place: Any) -> str:
    """A warning as it is printed: one of this package as its other sentences."""
    if Path(filename).is_relative_to(_PACKAGE):
        return f"hexmj: {literal(str(message))}\n"
    return _USUAL(message, category, filename, *place)
