"""Finished pieces of long work, each kept as a file: a run that was stopped does not do them again."""

import hashlib
import json
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.errors import InputError
from hexmj.results import save_dataset

if TYPE_CHECKING:
    import xarray as xr


def kept(folder: Path, name: str, settings: dict[str, Any], compute: Callable[[], "xr.Dataset"]) -> "xr.Dataset":
    """What `compute` gives, or what it gave in an earlier run; it is written as soon as it is there.

    A file is named by all that its content depends on, so none is ever overwritten or mistaken for another.

    Args:
        folder: keeps the files.
        name: begins the file's name.
        settings: all that the content depends on, as JSON can hold it; the package's version is added.
        compute: makes the content.

    Raises:
        InputError: a kept file is damaged.
    """
    settings = settings | {"version": version("hexmj")}
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:12]
    path = folder / f"{name.replace(' ', '-')}-{digest}.nc"
    if path.exists():
        return _load(path)
    data = compute().assign_attrs(settings=settings)
    save_dataset(data, path)
    return data


def _load(path: Path) -> "xr.Dataset":
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf") as data:
            return data.load()
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} is damaged ({error}); delete it, and it is made anew") from None
