"""An MJCF with the files that it is made of."""

import re
from html import unescape
from os.path import isfile
from pathlib import Path

from hexmj.storage.files import opened, read_bytes

NAMED = re.compile(r"""\b(file(?=name)?|meshdir|texturedir|assetdir)(?:name)?\s*=\s*(["'])(.*?)\2""")
"""Files and their folders in an MJCF, or in a URDF, where it is a filename."""

HEAD = 1000
"""Within so many bytes an MJCF has its first tag; what has none is a mesh or the like, and is not looked through."""


def parts(path: Path) -> list[Path]:
    """A file; of an MJCF all files that it includes or refers to, such as meshes, as far as they are there.

    They are looked for beside every file that names one and in every folder that is named, with or without their own.

    Raises:
        InputError: one cannot be read.
    """
    texts, new = dict[Path, str](), {path}
    while new:
        texts |= {one: _text(one) for one in new}
        told = [(kind, value) for text in texts.values() for kind, _, value in NAMED.findall(text)]
        named = told + [(kind, unescape(value)) for kind, value in told]
        names = {name for kind, value in named if kind == "file" for name in (value, Path(value).name)}
        folders = {
            one.parent / folder for one in texts for folder in ("", *(value for kind, value in named if kind != "file"))
        }
        new = {folder / name for folder in folders for name in names if isfile(folder / name)} - texts.keys()
    return sorted(texts)


def content(path: Path) -> bytes:
    """Of a file with all of its parts; errors as of `parts`."""
    return b"".join(map(read_bytes, parts(path)))


def _text(path: Path) -> str:
    with opened(path) as file:
        head = file.read(HEAD)
        return (head + file.read()).decode(errors="replace") if b"<" in head else ""
