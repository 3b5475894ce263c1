"""An MJCF with the files that it is made of."""

import re
from html import unescape
from os.path import isfile
from pathlib import Path

from hexmj.files import read_bytes

NAMED = re.compile(r"""\b(file|meshdir|texturedir|assetdir)\s*=\s*(["'])(.*?)\2""")
"""Files and their folders in an MJCF."""


def parts(path: Path) -> dict[Path, bytes]:
    """A file; of an MJCF all files that it includes or refers to, such as meshes, as far as they are there.

    They are looked for beside every file that names one and in every folder that is named, with or without their own.
    """
    found, new = dict[Path, bytes](), {path}
    while new:
        found |= {one: read_bytes(one) for one in new}
        texts = [text.decode(errors="replace") for text in found.values() if b"\0" not in text]
        told = [(kind, value) for text in texts for kind, _, value in NAMED.findall(text)]
        named = told + [(kind, unescape(value)) for kind, value in told]
        names = {name for kind, value in named if kind == "file" for name in (value, Path(value).name)}
        folders = {
            one.parent / folder for one in found for folder in ("", *(value for kind, value in named if kind != "file"))
        }
        new = {folder / name for folder in folders for name in names if isfile(folder / name)} - found.keys()
    return found


def content(path: Path) -> bytes:
    """Of a file with all of its parts."""
    found = parts(path)
    return b"".join(found[one] for one in sorted(found))
