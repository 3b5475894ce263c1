"""One HTML file that shows recordings, with all that it needs: nothing is loaded from anywhere."""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import xarray as xr

from hexmj.body import STICK_INSECT, Body
from hexmj.checks import path_of, typed
from hexmj.errors import InputError
from hexmj.files import write_text
from hexmj.replay.page.page_data import shown
from hexmj.replay.take import takes_of

MOST = 2
"""Recordings side by side, at most."""


def page(recordings: Sequence[xr.Dataset], path: Path | str, *, body: Body = STICK_INSECT) -> Path:
    """Write one recording, or two side by side with one clock, as a page that plays in any browser of today.

    The walk is drawn in 3D with its support polygon, centre of mass, planned and measured tips; beside it stand the
    footfall diagram and the stability margin, whose every value is the recording's own.

    Args:
        recordings: one or two.
        path: of the page, an HTML file; it appears whole or not at all, and its folder is made.
        body: the description of what was recorded.

    Returns:
        The path.

    Raises:
        InputError: no recording or too many, no HTML file, a recording without a pose or of another body, or a page
            that cannot be written.
    """
    path = path_of(path)
    if path.suffix != ".html":
        raise InputError(f"the page cannot be written to {path}; expected a name with .html")
    return write_text(path, page_text(recordings, body))


def page_text(recordings: Sequence[xr.Dataset], body: Body = STICK_INSECT) -> str:
    """The same as a text."""
    recordings = typed("recordings", recordings, tuple[xr.Dataset, ...])
    if not 1 <= len(recordings) <= MOST:
        raise InputError(f"{len(recordings)} recordings were given; expected 1 or {MOST}")
    typed("body", body, Body)
    takes = takes_of(recordings, body)
    told = [shown(recording, take) for recording, take in zip(recordings, takes, strict=True)]
    parts = {"STYLE": _part("page.css"), "SCRIPT": _part("page.js"), "RECORDINGS": script_json(told)}
    text = _part("page.html")
    for name, part in parts.items():
        before, after = text.split(f"<!--{name}-->")
        text = before + part + after
    return text


def script_json(value: object) -> str:
    """JSON that may stand in a script of HTML: nothing in it ends the script or begins a comment."""
    escapes = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}
    return json.dumps(value, allow_nan=False).translate(str.maketrans(escapes))


def _part(name: str) -> str:
    return files("hexmj.replay.page").joinpath(name).read_text(encoding="utf-8")
