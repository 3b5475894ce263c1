"""One of a process's writes goes wrong: refused, cut short, or the last thing that the process does."""

import errno
import io
import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ERRORS = {"EIO": errno.EIO, "ENOSPC": errno.ENOSPC, "EROFS": errno.EROFS, "torn": errno.ENOSPC}
"""What the system says."""

KINDS = "EIO", "torn", "short", "exit", "kill"
"""Torn: a disk that is full after half of the bytes, and stays so; short: half of the bytes, and no error; exit: before
the call; kill: SIGKILL after half of the bytes, or the call."""

LEFT = 77
"""Exit code of a process that left."""


@dataclass
class Disk:
    """Counts what is written below a folder, and spoils one of these calls."""

    folder: Path
    at: int | None = None
    """Which call, from 0 on; None spoils nothing."""
    kind: str = "EIO"
    again: bool = False
    """It stays so: all later ones are spoilt too."""
    calls: int = 0
    writes: list[int] = field(default_factory=list)
    """Which of the calls were writes; only these can be short."""

    def install(self) -> None:
        """Take the place of the calls by which files are written: mkdir, opening, write, fsync, replace."""
        for name in ("fsync", "replace"):
            setattr(os, name, self._spoilt(getattr(os, name)))
        usual_mkdir = os.mkdir
        os.mkdir = lambda path, *words: (
            self.call(usual_mkdir, path, *words)
            if self.holds(path) and not os.path.exists(path) and os.path.exists(os.path.dirname(path))
            else usual_mkdir(path, *words)
        )
        usual, disk = io.open, self

        class Raw(io.FileIO):
            def write(self, content: Any) -> int:
                return disk.write(super().write, bytes(content)) if disk.holds(self.name) else super().write(content)

        def spoilt_open(file: Any, mode: str = "r", *more: Any, **how: Any) -> Any:
            if not set(mode) & set("wxa+") or not disk.holds(file):
                return usual(file, mode, *more, **how)
            raw = disk.call(Raw, file, mode.replace("b", ""))
            return io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)

        io.open = spoilt_open
        usual_write = os.write
        os.write = lambda file, content: (
            self.write(lambda some: usual_write(file, some), bytes(content))
            if self.holds(file)
            else usual_write(file, content)
        )

    def holds(self, file: Any) -> bool:
        """A path, or an open file, below the folder."""
        try:
            name = os.readlink(f"/proc/self/fd/{file}") if isinstance(file, int) else os.fspath(file)
        except OSError:
            return False
        return f"{os.path.abspath(name)}/".startswith(f"{os.path.abspath(self.folder)}/")

    def call(self, usual: Callable[..., Any], *words: Any, **how: Any) -> Any:
        """One that does all or nothing."""
        spoilt = self._spoils()
        if spoilt:
            self._refuse(*ERRORS)
        result = usual(*words, **how)
        if spoilt and self.kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        return result

    def write(self, usual: Callable[[bytes], int], content: bytes) -> int:
        """One that may do half."""
        self.writes.append(self.calls)
        if not self._spoils():
            return usual(content)
        self._refuse("EIO", "ENOSPC", "EROFS")
        done = usual(content[: (len(content) + 1) // 2])
        if self.kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.kind == "torn":
            self.kind, self.again = "ENOSPC", True
        return done

    def _refuse(self, *kinds: str) -> None:
        if self.kind == "exit":
            os._exit(LEFT)
        if self.kind in kinds:
            raise OSError(ERRORS[self.kind], os.strerror(ERRORS[self.kind]))

    def _spoilt(self, usual: Callable[..., Any]) -> Callable[..., Any]:
        return lambda file, *words, **how: (
            self.call(usual, file, *words, **how) if self.holds(file) else usual(file, *words, **how)
        )

    def _spoils(self) -> bool:
        number, self.calls = self.calls, self.calls + 1
        return self.at is not None and (number == self.at or (self.again and number > self.at))
