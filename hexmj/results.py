"""Results on disk: NetCDF, figures and a manifest, each written whole or not at all."""

import json
import math
import os
import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

PACKAGES = ("hexmj", "mujoco", "numpy", "numba", "scipy", "cmaes", "dm-control", "xarray")


def results_folder(path: Path, names: Sequence[str]) -> Path:
    """The folder for results, if the files `names` can be written to it; it is made when the first one is.

    Raises:
        InputError: the path or a name in it is taken by something else, or cannot be written to.
    """
    nearest = next(p for p in (path, *path.absolute().parents) if p.exists())
    if not nearest.is_dir():
        raise InputError(f"--out {path}: {nearest} is a file; expected a folder")
    if not os.access(nearest, os.W_OK):
        raise InputError(f"--out {path}: {nearest} is not writable; expected a folder that is")
    if taken := [name for name in names if (path / name).is_dir()]:
        raise InputError(f"--out {path}: {taken[0]} is a folder there; expected a file or nothing")
    return path


def write_whole(path: Path, write: Callable[[Path], Any]) -> Path:
    """Let `write` make a file beside `path`, then put it in the place of `path`; on failure `path` stays as it was.

    Raises:
        InputError: the file cannot be written.
    """
    part = path.with_name(f".part-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part)
        os.replace(part, path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        if part.exists():
            part.unlink()
    return path


def save_dataset(data: "xr.Dataset", path: Path) -> Path:
    """Write a dataset as NetCDF; settings that NetCDF has no type for become JSON text."""
    plain = data.copy()
    plain.attrs = {
        key: value if type(value) in (str, int, float) else json.dumps(value, default=str)
        for key, value in data.attrs.items()
    }
    return write_whole(path, lambda part: plain.to_netcdf(part, engine="h5netcdf"))


def save_manifest(settings: dict[str, Any], path: Path) -> Path:
    """Write what is needed to run the same again: settings (the seed among them) and versions."""
    from importlib.metadata import version

    versions = {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}
    text = json_text({"settings": settings, "versions": versions, "machine": platform.machine()})
    return write_whole(path, lambda part: part.write_text(text + "\n", encoding="utf-8"))


def json_text(value: Any) -> str:
    """JSON with null for numbers that are not finite."""
    return json.dumps(_finite(value), indent=2, default=str)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
