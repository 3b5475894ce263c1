"""`hexmj rerun`."""

import io
import shlex
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from hexmj.cli.command_words import deciding, typed
from hexmj.cli.commands import options_of
from hexmj.cli.manifest import Manifest, changed_files, differences, manifests, told
from hexmj.cli.tables import print_json, show, table
from hexmj.errors import InputError, SimulationError
from hexmj.storage.same_numbers import Compared, check_readable, compared, holds_numbers

if TYPE_CHECKING:
    from rich.table import Table

UNSEEN = "not compared"
ABSENT = "not made this time"
NUMBERLESS = "names no file with numbers"
NOTHING = "nothing that the manifest knows of differs (files that your code reads it does not know)"


@dataclass(frozen=True)
class Rerun:
    """Options of `hexmj rerun`, which `commands.COMMANDS` describes."""

    result: Positional[Path]
    """A folder that a command wrote results to, or one manifest in it; of several in a folder, every one with numbers
    is repeated. Files that the command named, such as mine.py, are looked for in the current folder."""
    threads: int | None = None
    """As of the command that is repeated.  No result depends on it."""
    processes: int | None = None
    """As of the command that is repeated, where it has this option.  No result depends on it."""
    scheduler: str | None = None
    """As of the command that is repeated, where it has this option; its workers must see this machine's folder for
    temporary files (TMPDIR).  No result depends on it."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """Repeat, compare and print; ends the program, with exit code 1 if anything differs."""
        found = manifests(self.result)
        pictures = [path for path, manifest in found.items() if not any(map(holds_numbers, manifest.files))]
        if len(pictures) == len(found):
            raise InputError(f"{pictures[0]} {NUMBERLESS}; expected a result with NetCDF, JSON or TOML")
        for path in pictures:
            del found[path]
        for path, manifest in found.items():
            _check(path, manifest)
        workers = {"--threads": self.threads, "--processes": self.processes, "--scheduler": self.scheduler}
        more = [word for option, one in workers.items() if one is not None for word in (option, str(one))]
        repeated = [_repeat(path, manifest, more) for path, manifest in found.items()]
        equal = all(one.equal for one in repeated)
        if self.json:
            print_json({"equal": equal, "results": [one.summary() for one in repeated], "not_repeated": pictures})
        else:
            for one in repeated:
                show(*one.shown())
            show(*(f"{path} {NUMBERLESS}, and was not repeated" for path in pictures))
        sys.exit(0 if equal else 1)


@dataclass(frozen=True)
class _Repeated:
    """A result beside what came of the same words now."""

    path: Path
    """Of the manifest."""
    command: list[str]
    """The words."""
    files: dict[str, list[Compared] | str]
    """Name of a file -> its variables, or why it was not compared."""
    differs: dict[str, list[str]]
    """What the manifests know to differ, as of `differences`, and files that were changed."""

    @property
    def variables(self) -> list[Compared]:
        """Of all files."""
        return [one for rows in self.files.values() if not isinstance(rows, str) for one in rows]

    @property
    def equal(self) -> bool:
        """Every number was made again, at least one, and is equal to the last bit."""
        return (
            ABSENT not in self.files.values()
            and any(one.values for one in self.variables)
            and not any(one.differ or one.misfit for one in self.variables)
        )

    @property
    def sentence(self) -> str:
        """Whether all is equal, and what may be the reason if not."""
        values, differ = (sum(getattr(one, name) for one in self.variables) for name in ("values", "differ"))
        reasons = told(self.differs)
        if self.equal:
            sentence = f"All {values} values are equal to the last bit"
            return f"{sentence}, although not all is as it was: {reasons}" if reasons else sentence
        absent = [f"{name} was {ABSENT}" for name, rows in self.files.items() if rows == ABSENT]
        why = f"what else differs, and may be why: {reasons}" if reasons else NOTHING
        return "; ".join([f"{differ} of {values} values differ", *absent, why])

    def summary(self) -> dict[str, Any]:
        """As JSON."""
        files = {
            name: rows if isinstance(rows, str) else [asdict(one) for one in rows] for name, rows in self.files.items()
        }
        answer = {"manifest": self.path, "command": self.command, "equal": self.equal}
        return answer | {"sentence": self.sentence, "differs": self.differs, "files": files}

    def shown(self) -> "Iterator[str | Table]":
        """As lines and a table."""
        rows = []
        for name, found in self.files.items():
            if isinstance(found, str):
                rows.append((name, "", "", found))
            else:
                rows += [(name, one.name, str(one.values), _verdict(one)) for one in found]
        yield f"{self.path}: hexmj {shlex.join(self.command)}"
        yield table(("file", "variable", "values", "equal to the last bit"), rows)
        yield self.sentence


def _check(path: Path, manifest: Manifest) -> None:
    """Refuse what cannot be repeated or compared, before anything is."""
    numbers = [name for name in manifest.files if holds_numbers(name)]
    if missing := [name for name in numbers if not (path.parent / name).is_file()]:
        raise InputError(f"{path} names {missing[0]}, which is not beside it; expected the whole result")
    if missing := [name for name in manifest.own if not Path(name).is_file()]:
        raise InputError(
            f"{missing[0]}, with which {path} was made, is no file here; expected to run where that name leads to it"
        )
    for name in numbers:
        try:
            check_readable(path.parent / name)
        except InputError as error:
            since = "; it was changed after it was written" if name in changed_files(manifest, path.parent) else ""
            raise InputError(f"{error}{since}") from None


def _repeat(path: Path, then: Manifest, more: list[str]) -> _Repeated:
    """Run the words of a manifest again, in a folder of their own, and compare what comes of them."""
    words = deciding(then.command)
    with TemporaryDirectory(prefix="hexmj-rerun-") as folder:
        with redirect_stdout(io.StringIO()), typed(words):
            try:
                options = options_of([*words, *more, "--out", folder])
            except SystemExit:
                raise InputError(f"{path}: this version cannot run hexmj {shlex.join([*words, *more])}") from None
            try:
                options.run()
            except SimulationError as error:
                raise SimulationError(f"{path}: made again, it failed: {error}") from None
        (now,) = manifests(Path(folder)).values()
        files = {name: _file(name, path.parent, Path(folder)) for name in then.files | now.files}
    changed = changed_files(then, path.parent)
    return _Repeated(path, words, files, differences(then, now) | ({"files": changed} if changed else {}))


def _file(name: str, then: Path, now: Path) -> list[Compared] | str:
    """The variables of a file, or why they are not compared."""
    if not (now / name).is_file():
        return ABSENT if holds_numbers(name) else f"{UNSEEN}, {ABSENT}"
    if not (then / name).is_file():
        return f"{UNSEEN}, not there then"
    return compared(then / name, now / name) if holds_numbers(name) else UNSEEN


def _verdict(one: Compared) -> str:
    if one.misfit or not one.differ:
        return one.misfit or "equal"
    return f"{one.differ} differ" + (f", by at most {one.most:.3g}" if one.most is not None else "")
