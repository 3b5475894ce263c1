"""Python files of a user's own, such as `mine.py`, imported from where they lie.

Such a file becomes the module `hexmj.user_code.loaded.<its path, quoted>@<digest of its source>`.  The name says where
it lies, so pickle, which knows classes and functions by the names of their modules, finds them in any process that sees
the same file; and an edited file is another module, never mistaken for the one that is already loaded.
"""

import ast
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from importlib.abc import MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from urllib.parse import quote_from_bytes, unquote_to_bytes

from hexmj.errors import InputError
from hexmj.storage.files import digest
from hexmj.user_code.parsing import parsed
from hexmj.user_code.sources_as_run import is_users

__path__: list[str] = []
"""Makes this module a package: its modules are the loaded files."""


def importable(path: str | Path) -> ModuleType:
    """The module of a file; the same one as long as the file is not edited.

    Raises:
        InputError: the file cannot be read or does not run.
    """
    path = Path(path).absolute()
    try:
        return import_module(module_name(path, digest(path.read_bytes())))
    except OSError as error:
        raise InputError(f"{path} cannot be loaded: {error.strerror or error}") from None
    except InputError:
        raise
    except Exception as error:
        told = f"{type(error).__name__}: {error}"
        missing = str(error.name) if isinstance(error, ImportError) else ""
        if missing.startswith("hexmj.user_code"):
            told = "it imports relatively; expected module:object of its package, or a file that stands alone"
        if isinstance(error, ModuleNotFoundError):
            beside = (path.parent / f"{missing}{end}" for end in (".py", os.sep))
            if missing.isidentifier() and any(map(os.path.exists, beside)):
                told += "; it lies beside it: expected to run in that folder, or with that in PYTHONPATH"
        raise InputError(f"{path} cannot be loaded: {told}") from error


def module_name(path: Path, stamp: str) -> str:
    """Of the module that a file, by its absolute path, becomes in the version with this digest."""
    return f"{__name__}.{quote_from_bytes(os.fsencode(path), safe='').replace('.', '%2E')}@{stamp}"


class _Source(SourceLoader):
    """Runs a file as it is named; writes no bytecode beside it."""

    def get_filename(self, fullname: str) -> str:
        return os.fsdecode(unquote_to_bytes(fullname.removeprefix(f"{__name__}.").rpartition("@")[0]))

    def get_data(self, path: str | bytes) -> bytes:
        return Path(os.fsdecode(path)).read_bytes()

    def exec_module(self, module: ModuleType) -> None:
        path = self.get_filename(module.__name__)
        if not module.__name__.endswith(f"@{digest(self.get_data(path))}"):
            raise InputError(f"{path} was edited while it was in use; start again")
        super().exec_module(module)
        _check_helpers(Path(path), self.get_data(path))


def _check_helpers(file: Path, source: bytes) -> None:
    """Refuse a file that imports a user's module of another folder, though one of that name lies beside it, and such
    helpers of it: Python knows one module by each name, and takes the one that it met first."""
    waiting, seen = [(file, source)], {file}
    while waiting:
        file, source = waiting.pop()
        for name in _imported(source):
            taken = Path(getattr(sys.modules.get(name), "__file__", None) or os.devnull)
            if not taken.is_file() or not is_users(str(taken)):
                continue
            stem = file.parent.joinpath(*name.split("."))
            for beside in (stem.with_name(f"{stem.name}.py"), stem / "__init__.py"):
                if beside.is_file() and not beside.samefile(taken):
                    raise InputError(
                        f"{file} imports {name}, which is {taken} in this program, though {beside} lies beside it;"
                        " expected one module of a name: rename one, or run them one after the other"
                    )
            if taken not in seen:
                seen.add(taken)
                waiting.append((taken, taken.read_bytes()))


def _imported(source: bytes) -> list[str]:
    """Names of the modules that a source may import, with those that they lie in."""
    names = list[str]()
    with suppress(SyntaxError, ValueError):  # of what is no Python
        for one in ast.walk(parsed(source)):
            if isinstance(one, ast.Import):
                names += [alias.name for alias in one.names]
            elif isinstance(one, ast.ImportFrom) and one.module and not one.level:
                names += [one.module, *(f"{one.module}.{alias.name}" for alias in one.names)]
    parts = [name.split(".") for name in names]
    return list(dict.fromkeys(".".join(part[:n]) for part in parts for n in range(1, len(part) + 1)))


class _Finder(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if not (fullname.startswith(f"{__name__}.") and "@" in fullname):
            return None
        loader = _Source()
        return spec_from_file_location(fullname, loader.get_filename(fullname), loader=loader)


sys.meta_path.append(_Finder())
