"""Manifests: what a result was made by, so that it can be made again, and what of that differs from another's."""

import json
import platform
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from hexmj.cli import command_words
from hexmj.cli.loaded import check_loaded
from hexmj.errors import InputError
from hexmj.storage.files import DIGEST, STAMP, WRITTEN, digest_of, is_as_written, read_text
from hexmj.storage.literal import literal
from hexmj.storage.results import json_text, save_text
from hexmj.sweeps.code import code
from hexmj.user_code.loaded import importable, module_name
from hexmj.version import __version__

FORMAT = 2
"""Of the file; 1 had settings and versions only."""

MANIFEST = "manifest.json"
"""Name of the file, or its end."""

KINDS = {
    "versions": "versions",
    "code": "code",
    "own": "your files",
    "processor": "processor",
    "settings": "settings",
    "files": "changed since they were written",
}
"""What may differ -> what it is called."""

SHOWN = 8
"""Most names of a kind in a sentence."""


@dataclass(frozen=True)
class Manifest:
    """What a result was made by."""

    command: list[str]
    """The words behind `hexmj`, without those on which no number depends."""
    settings: dict[str, Any]
    """What came of the words, the seed among it."""
    versions: dict[str, str]
    """Of Python, the packages that compute, and the C library."""
    code: dict[str, str]
    """Module, or data file of this package, that the command may need -> digest."""
    own: dict[str, str]
    """The user's files that the words name, as they name them -> digest."""
    processor: list[str]
    """Architecture and vector extensions, as NumPy calls them."""
    files: dict[str, str]
    """What was written, by its path in the manifest's folder -> digest."""


def save_manifest(command: Any, settings: dict[str, Any], written: Iterable[Path], path: Path) -> Path:
    """Write what is needed to make a result again, whose files are `written` to the manifest's folder or to one in it.

    The code is followed from the module of the command's options.

    Raises:
        InputError: the code, or what a controller names, was edited meanwhile, one of those files was removed or
            written by something else, or a file cannot be written or read.
    """
    check_loaded()
    for file in (written := [*written]):
        if not file.is_file():
            raise InputError(f"{file} was removed or renamed while the command ran; expected it to stay")
        if not is_as_written(file):
            raise InputError(f"{file} was written by something else while the command ran; expected it to stay")
    typed = command_words.command()
    own = {str(file): one for file, one in command_words.own().items()}
    made = code(frozenset({type(command).__module__, *_modules(typed)}))
    told = Manifest(
        command=typed,
        settings=settings,
        versions=_versions() | made.versions | {"python": platform.python_version()},
        code={name: one for name, one in made.sources.items() if name.partition("@")[2] not in own.values()},
        own=own,
        processor=_processor(),
        files={file.relative_to(path.parent).as_posix(): WRITTEN[file.absolute()][:DIGEST] for file in written},
    )
    before = _before(path)
    if before and before.command != told.command:
        was = literal(" ".join(["hexmj", *before.command]))
        print(f"hexmj: {literal(str(path.parent))} held what {was} wrote; this has taken its place", file=sys.stderr)
    for name in [one for one in (before.files if before else ()) if one not in told.files]:
        if (path.parent / name).is_file():
            print(f"hexmj: {literal(str(path.parent / name))} is left from an earlier command", file=sys.stderr)
    return save_text(json_text({"format": FORMAT} | asdict(told)) + "\n", path)


def _before(path: Path) -> Manifest | None:
    """What lies where a manifest is to be written, if that is one."""
    try:
        return read_manifest(path) if path.is_file() else None
    except InputError:
        return None


def read_manifest(path: Path) -> Manifest:
    """A manifest that `save_manifest` wrote.

    Raises:
        InputError: it cannot be read, is none, of another format, or not of a command.
    """
    try:
        told = json.loads(read_text(path, 10_000_000))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(told, dict) or "settings" not in told:
        raise InputError(f"{path} is no manifest; expected one that a hexmj command wrote")
    if (found := told.pop("format", 1)) != FORMAT:
        raise InputError(f"{path} has format {found!r:.20}; expected {FORMAT}: make the result anew with this version")
    for name, kind in Manifest.__annotations__.items():
        if not _fits(told.get(name), kind):
            raise InputError(f"{path}: {name} = {told.get(name)!r:.80}; expected {kind}")
    if not told["command"]:
        raise InputError(f"{path} names no command; expected a result that a hexmj command wrote")
    return Manifest(**{name: told[name] for name in Manifest.__annotations__})


def manifests(result: Path) -> dict[Path, Manifest]:
    """A manifest, or all that lie in a folder, by their paths.

    Raises:
        InputError: there is none, or one makes no sense.
    """
    if result.is_file() and result.suffix != ".json":
        raise InputError(f"{result} is no manifest; expected one, or a folder that a hexmj command wrote results to")
    paths = sorted(result.glob(f"*{MANIFEST}")) if result.is_dir() else [result]
    if not paths:
        raise InputError(f"{result} holds no {MANIFEST}; expected a folder that a hexmj command wrote results to")
    return {path: read_manifest(path) for path in paths}


def changed_files(then: Manifest, folder: Path) -> list[str]:
    """Files of a result that are there, but not as they were written."""
    there = {name: one for name, one in then.files.items() if (folder / name).is_file()}
    return [name for name, one in there.items() if digest_of(folder / name) != one]


def differences(then: Manifest, now: Manifest) -> dict[str, list[str]]:
    """What differs between two manifests of one command, by its kind, each in a few words; no kind is empty."""
    found = {
        "versions": [
            f"{name} {then.versions.get(name, 'unknown')}, now {now.versions.get(name, 'unknown')}"
            for name in _unlike(then.versions, now.versions)
        ],
        "code": list(dict.fromkeys(STAMP.sub("", name) for name in _unlike(then.code, now.code))),
        "own": _unlike(then.own, now.own),
        "processor": [
            *(f"{one} then, not now" for one in then.processor if one not in now.processor),
            *(f"{one} now, not then" for one in now.processor if one not in then.processor),
        ],
        "settings": _unlike(dict(_flat(then.settings)), dict(_flat(now.settings))),
    }
    return {kind: names for kind, names in found.items() if names}


def told(found: dict[str, list[str]]) -> str:
    """What differs, as the end of a sentence."""

    def few(names: list[str]) -> str:
        return "; ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")

    return ", ".join(f"{KINDS[kind]} ({few(names)})" for kind, names in found.items())


def _modules(typed: Sequence[str]) -> Iterator[str]:
    """Modules of the user's own that words name: of files, by their names, or by entry points."""
    from hexmj.controllers.named import ENTRY_POINTS

    points = {point.name: point.module for point in entry_points(group=ENTRY_POINTS)}
    for file, stamp in command_words.own().items():
        if file.suffix == ".py":
            name = module_name(file.absolute(), stamp)
            yield name if name in sys.modules else importable(file).__name__
    for name in command_words.named(typed):
        module = points.get(name) or name.rpartition(":")[0]
        if (getattr(sys.modules.get(module), "__file__", None) or "").endswith(".py"):
            yield module


def _versions() -> dict[str, str]:
    libc, number = platform.libc_ver()
    return {"hexmj": __version__} | ({libc: number} if libc else {})


def _processor() -> list[str]:
    """MuJoCo's results, and those of the C library's sines, depend on it."""
    extensions: Any = np.show_config(mode="dicts")
    extensions = extensions.get("SIMD Extensions", {})
    return [platform.machine(), *extensions.get("baseline", ()), *extensions.get("found", ())]


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value of JSON is a list or dictionary as annotated."""
    if kind == dict[str, Any]:
        return isinstance(value, dict)
    items = value.values() if isinstance(value, dict) else value
    return isinstance(value, kind.__origin__) and all(isinstance(one, str) for one in items)


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The single settings of nested ones, by their names with dots between; lists count as one."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from _flat(one, f"{name}.{key}" if name else key)
    else:
        yield name, value


def _unlike(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Keys whose values are not the same, or that only one has."""
    missing = object()
    return [key for key in then | now if then.get(key, missing) != now.get(key, missing)]
