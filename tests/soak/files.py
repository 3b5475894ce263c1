"""Files that the package reads, damaged."""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import xarray as xr
from hypothesis import strategies as st

import hexmj
from hexmj.bodies.loading import compile_body
from hexmj.controllers.cruse1998.presets import network_toml

WORDS = b"nan", b"-1", b"1e999", b"\xff\xfe", b"[[[[", b'"""', b"9" * 5000, b"{}<>", b"[" * 5000


def _recording(path: Path) -> None:
    with hexmj.load_recording(path) as read:
        if not read.identical(originals()[1]):
            raise AssertionError("other values than were written")


READERS: dict[str, Callable[[Path], Any]] = {
    "recording.nc": _recording,
    "weights.toml": lambda path: hexmj.load_controller(str(path)),
    "insect.xml": lambda path: compile_body(hexmj.Conditions(body=replace(hexmj.STICK_INSECT, mjcf=path))),
}
"""Name of a file -> what reads it."""


@cache
def originals() -> tuple[dict[str, bytes], xr.Dataset]:
    """Name of each file -> what it holds; and the recording, as it is read."""
    walked = hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 3.0)
    with TemporaryDirectory(prefix="hexmj-originals-") as folder:
        path = hexmj.save_recording(hexmj.record(walked), Path(folder) / "recording.nc")
        with hexmj.load_recording(path) as recording:
            whole = {path.name: path.read_bytes(), "weights.toml": network_toml(hexmj.LDVS).encode()}
            return whole | {"insect.xml": hexmj.STICK_INSECT.mjcf.read_bytes()}, recording.load()


@st.composite
def damages(draw: st.DrawFn) -> tuple[str, bytes]:
    """The name of a file, and its bytes after some accident."""
    name = draw(st.sampled_from(tuple(READERS)))
    whole = bytearray(originals()[0][name])
    for _ in range(draw(st.integers(1, 3))):
        size = len(whole)
        at, other = draw(st.integers(0, max(0, size - 1))), draw(st.integers(0, size))
        accident = draw(st.sampled_from(("flip", "cut", "zeros", "words", "twice", "without")))
        if accident == "flip" and size:
            whole[at] ^= 1 << draw(st.integers(0, 7))
        elif accident == "cut":
            del whole[at:]
        elif accident == "zeros":
            whole[at : at + 64] = bytes(len(whole[at : at + 64]))
        elif accident == "words":
            whole[at:at] = draw(st.sampled_from(WORDS))
        elif accident == "twice":
            whole += whole[min(at, other) :]
        else:
            del whole[min(at, other) : max(at, other)]
    return name, bytes(whole)


def damaged(damage: tuple[str, bytes]) -> None:
    """What reading the damaged file does, in the current folder."""
    name, content = damage
    Path(name).write_bytes(content)
    try:
        READERS[name](Path(name))
    except hexmj.InputError as error:
        print(error, file=sys.stderr)
        raise SystemExit(1) from None
