"""Files of data that texts of a user's own modules name, of which some may be opened unheard."""

from pathlib import Path

from hexmj.errors import InputError
from hexmj.storage.mjcf import parts
from hexmj.sweeps.code import texts_of_users
from hexmj.user_code import sources_as_run
from hexmj.user_code.opened_files import spelled
from hexmj.user_code.parsing import named_there

_MODELS = ".xml", ".mjcf", ".urdf"
"""Ends of the names of models that MuJoCo opens with all their parts, in small letters or capitals."""

_UNHEARD = *_MODELS, ".mjb", ".pt", ".pth", ".onnx", ".safetensors", ".h5", ".hdf5", ".parquet"
"""The same of all that libraries may open by themselves, where nobody hears it."""

_DATA = *_UNHEARD, ".toml", ".json", ".jsonl", ".yaml", ".yml", ".csv", ".tsv", ".txt", ".npy", ".npz", ".pkl"
"""The same of all data of a user's own."""

OPEN_BY_THEMSELVES = {"cv2", "duckdb", "polars", "pyarrow"}
"""Packages that open any data unheard."""

_DEEP = 3
"""So many folders above one another are looked through for what texts of a user's own name, and so many within."""


def data_of_users(modules: frozenset[str]) -> tuple[set[str], set[str]]:
    """Of the data that texts of these name, as far as they are there: what may be opened unheard, with its parts, and
    the rest.

    Files are looked for beside each module, in the current folder, in those above them, and in folders there that texts
    name.

    Raises:
        InputError: a module has no source; a file cannot be read.
    """
    theirs = texts_of_users(modules)
    named = {text for _, one in theirs for text in one}
    if not any(text.lower().endswith(_DATA) for text in named):
        return set(), set()
    before = tuple(f"/{text}" for file, one in theirs if str(file) in sources_as_run.BEFORE for text in one)
    beside = [Path.cwd() / "here", *(file for file, _ in theirs)]
    folders = [folder for one in beside for folder in one.parents[:_DEEP]]
    found = [one for one in named_there(named, folders, _DEEP) if one.name.lower().endswith(_DATA) and one.is_file()]
    unheard = {one for one in found if one.name.lower().endswith(_UNHEARD) or one.as_posix().endswith(before)}
    whole = {spelled(part) for path in unheard for part in _parts(path)}
    return whole, {spelled(path) for path in found} - whole


def _parts(path: Path) -> list[Path]:
    """A file with all that MuJoCo opens with it; none once it is gone."""
    try:
        return parts(path) if path.name.lower().endswith(_MODELS) else [path]
    except InputError as error:
        if isinstance(error.__context__, FileNotFoundError):
            return []
        raise
