"""Results on disk: NetCDF, figures and a manifest, each written whole or not at all."""

import json
import math
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

PACKAGES = ("hexmj", "mujoco", "numpy", "numba", "scipy", "dm-control", "xarray")


def results_folder(path: Path) -> Path:
    """The folder for results, made if it is missing.

    Raises:
        InputError: the path is a file, or cannot be written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {path} cannot be made: {error.strerror}; expected a folder") from None
    if not os.access(path, os.W_OK):
        raise InputError(f"--out {path} is not writable; expected a folder that is")
    return path


def write_whole(path: Path, write: Callable[[Path], Any]) -> Path:
    """Let `write` make a file beside `path`, then put it in the place of `path`; on failure `path` stays as it was."""
    part = path.with_name(f".part-{path.name}")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
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
