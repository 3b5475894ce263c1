"""Files, written whole or not at all, and read only if they are files; what must come back unchanged is sealed.

A sealed file ends with a checksum of all that stands before it: 80 bytes that readers of NetCDF and NPZ do not mind.
"""

import hashlib
import os
import re
import shutil
import stat
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO
from uuid import uuid4

from hexmj.errors import InputError
from hexmj.storage.locks import among_writers

MARK = b"\nhexmj, sha256 "
"""Between the content of a sealed file and its checksum."""

SEAL = len(MARK) + 64
"""Length of both [bytes]."""

SEARCHED = "searched"
"""What a TOML that `hexmj search` wrote tells of the starts on which it searched."""

WRITTEN: dict[Path, str] = {}
"""File -> SHA-256 of what this process wrote to it last, whatever another one has put there since."""

_STATES: dict[Path, tuple[int, ...]] = {}
"""The same file -> what the system told of it then."""

_DIGESTS: dict[tuple[int, ...], str] = {}
"""A file by device, inode, size and times of its last changes -> digest."""

WRITING: set[Path] = set()
"""What this process is writing at this moment."""

DIGEST = 12
"""Digits of a digest."""

STAMP = re.compile(f"@[0-9a-f]{{{DIGEST}}}")
"""A digest behind the name of what it is of."""

SETTLED = 2_000_000_000
"""Age of a file's last change from which on its times tell whether it was touched, whatever their resolution [ns]."""

PART = ".part-"
"""Begins the names of files that are being written; a killed process leaves them, the next run removes them."""


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all, whoever else writes the same.

    Raises:
        InputError: it cannot be written; what stood there before still does.
    """
    with replacing(path) as part, part.open("xb") as file:
        file.write(content)
    return path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A name of its own beside `path`, absolute, to write to: what is there in the end takes the place of `path`, or
    of what that links to.

    Raises:
        InputError: it cannot be written; what stood there before still does.
    """
    real = Path(os.path.realpath(path))
    part = real.with_name(f"{PART}{uuid4().hex}{path.suffix}")
    WRITING.add(part)
    try:
        if real.exists() and not (real.is_file() or real.is_dir()):
            raise InputError(f"{path} is a pipe or a device; expected a file, or nothing yet")
        if real.exists() and not os.access(real, os.W_OK):
            raise InputError(f"{path} may only be read; expected a file that may be written, or nothing yet")
        path.parent.mkdir(parents=True, exist_ok=True)
        with among_writers(real.parent):
            yield part
            with part.open("rb+") as file:
                os.fsync(file.fileno())
                WRITTEN[path.absolute()] = hashlib.file_digest(file, "sha256").hexdigest()
            if real.exists():
                shutil.copymode(real, part)  # as whoever shares it, or does not, has set it
            ours = state_of(part)
            os.replace(part, real)
            _STATES[path.absolute()] = (*ours[:-1], *state_of(real)[-1:])  # which the new name has set
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        WRITING.discard(part)


def prepare(folder: Path) -> None:
    """Make a folder, see that it can be written to, and remove what killed processes left there half written.

    Raises:
        InputError: it cannot be made, or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try_writing(folder)
    except FileExistsError:
        raise InputError(f"{folder} is a file, or a link to nothing; expected a folder") from None
    except OSError as error:
        raise InputError(f"{folder} cannot be written to: {error.strerror or error}") from None
    remove_leftovers(folder)


def try_writing(folder: Path) -> None:
    """Write a file into a folder and remove it, or raise OSError."""
    part = folder / f"{PART}{uuid4().hex}"
    try:
        part.write_bytes(bytes(4096))
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def marked(folder: Path) -> Iterator[Path]:
    """A file in a folder while the block runs, by which others tell that they see the same folder.

    Raises:
        InputError: the folder cannot be written to.
    """
    mark = folder / f"{PART}{uuid4().hex}"
    with among_writers(folder):
        try:
            mark.touch()
        except OSError as error:
            raise InputError(f"{folder} cannot be written to: {error.strerror or error}") from None
        try:
            yield mark
        finally:
            with suppress(OSError):
                mark.unlink(missing_ok=True)


def remove_leftovers(folder: Path) -> None:
    """Remove what killed processes left half written in a folder, unless somebody writes into it at this moment."""
    with among_writers(folder, alone=True) as alone:
        for part in folder.glob(f"{PART}{'[0-9a-f]' * 32}*") if alone else ():
            with suppress(OSError):
                part.unlink()


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """A file to be read; never a pipe or a device, which might have no end.

    Raises:
        InputError: there is no file, or it cannot be read.
    """
    try:
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise InputError(f"{path} is a pipe or a device; expected a file")
            yield file
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; expected a file, as one in it") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_bytes(path: Path) -> bytes:
    """What a file holds.

    Raises:
        InputError: it cannot be read.
    """
    with opened(path) as file:
        return file.read()


def digest_of(path: Path) -> str:
    """Of a file as it is now; one that has not been touched since is not read again.

    Raises:
        InputError: it cannot be read.
    """
    with opened(path) as file:
        now = os.fstat(file.fileno())
        known = now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns
        if (found := _DIGESTS.get(known)) is None:
            found = hashlib.file_digest(file, "sha256").hexdigest()[:DIGEST]  # pyright: ignore[reportArgumentType]
            if time.time_ns() - max(now.st_mtime_ns, now.st_ctime_ns) > SETTLED:
                _DIGESTS[known] = found
    return found


def is_as_written(path: Path) -> bool:
    """Whether a file is as this process wrote it last; it is read only if something else has touched it since.

    Raises:
        InputError: it cannot be read.
    """
    there = path.absolute()
    return state_of(path) == _STATES[there] or digest_of(path) == WRITTEN[there][:DIGEST]


def state_of(path: Path | str) -> tuple[int, ...]:
    """What tells whether a file has changed, without opening it; nothing of one that is not there."""
    with suppress(OSError):
        told = os.stat(path)
        return told.st_dev, told.st_ino, told.st_size, told.st_mtime_ns, told.st_ctime_ns
    return ()


def digest(content: bytes) -> str:
    """Of some bytes: the first digits of their SHA-256."""
    return hashlib.sha256(content).hexdigest()[:DIGEST]


def read_text(path: Path, most: int = 1_000_000) -> str:
    """A text in UTF-8, with a byte-order mark or without.

    Raises:
        InputError: it cannot be read, or is longer than `most` bytes.
    """
    with opened(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InputError(f"{path} is longer than {most / 1e6:g} MB; expected a shorter text")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8: {error.reason} at byte {error.start}") from None


def read_toml(path: Path) -> dict[str, Any]:
    """The table of a TOML file.

    Raises:
        InputError: it cannot be read, or is no TOML.
    """
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from None


def sealed(content: bytes) -> bytes:
    """A content and its checksum."""
    return content + MARK + hashlib.sha256(content).hexdigest().encode()


def unsealed(whole: bytes) -> bytes | None:
    """What was sealed; None where a bit of it, or of the seal, is another one."""
    content, seal = whole[:-SEAL], whole[-SEAL:]
    return content if seal == MARK + hashlib.sha256(content).hexdigest().encode() else None


def read_sealed(path: Path) -> bytes | None:
    """The content of a sealed file; of any other, None, and no more than its end is read.

    Raises:
        InputError: it cannot be read.
    """
    with opened(path) as file:
        file.seek(-min(SEAL, file.seek(0, os.SEEK_END)), os.SEEK_END)
        if not file.read().startswith(MARK):
            return None
        file.seek(0)
        return unsealed(file.read())
