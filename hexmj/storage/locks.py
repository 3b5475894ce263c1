"""A folder for one process, or for writers, at a time, where the system has such locks; a killed process holds none."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hexmj.errors import InputError

try:
    import fcntl
except ImportError:  # no Unix
    fcntl = None

FLAGS = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)
"""No pipe is waited for, and no link is followed."""

NAME = ".lock"
"""File that is locked, in the folder; says who holds it."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder, which is made, while the block runs.

    Raises:
        InputError: another process holds it, or it cannot be written to.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = _held(path)
    except BlockingIOError:
        raise InputError(
            f"{folder} is in use by {_holder(path)}; wait until it ends, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(f"{folder} cannot be written: {error.strerror or error}") from None
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(file)


@contextmanager
def among_writers(folder: Path, alone: bool = False) -> Iterator[bool]:
    """Write into a folder while the block runs, as others may; or see to it that nobody does.

    Args:
        folder: which is there.
        alone: without other writers, if there are none at this moment; new ones wait.

    Yields:
        Whether this is sure: not where the system has no such locks.
    """
    file, sure = None, False
    try:
        with suppress(OSError):
            file = os.open(folder, os.O_RDONLY)
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if alone else fcntl.LOCK_SH)
                sure = True
        yield sure
    finally:
        if file is not None:
            if fcntl:
                with suppress(OSError):
                    fcntl.flock(file, fcntl.LOCK_UN)  # closing is not enough where the process was forked meanwhile
            os.close(file)


def _held(path: Path) -> int:
    """The lock file, held, and not one that its holder has taken away by now."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | FLAGS, 0o666)
        try:
            if os.fstat(file).st_nlink > 1:
                raise OSError(f"{NAME} is a link to another file")
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.stat(path), os.fstat(file)):
                    os.ftruncate(file, 0)
                    os.write(file, f"process {os.getpid()} on {socket.gethostname()}".encode())
                    return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)


def _holder(path: Path) -> str:
    with suppress(OSError, UnicodeDecodeError):
        return path.read_bytes()[:200].decode() or "another process"
    return "another process"
