"""Results on disk: NetCDF with settings as attributes, figures, JSON, and the manifest of a command."""

import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.files import read_netcdf, replacing, write_netcdf, write_text
from hexmj.version import __version__

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TEXTS = ("study", "model", "over", "reference", "title", "body", "ground")
"""Attributes that `settings` returns as text, even if the text looks like JSON."""

MANIFEST = "manifest.json"
"""Name of the file that records how results were made."""

LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "xarray", "matplotlib")
"""Packages whose versions a manifest records, in addition to hexmj and Python."""


def load(path: Path | str) -> "xr.Dataset":
    """Read a result that a command or `save` wrote.

    Args:
        path: NetCDF file, such as "results/compare/comparison.nc".

    Raises:
        InputError: the file cannot be read.
    """
    return read_netcdf(path)


def save(result: "xr.Dataset", path: Path | str) -> Path:
    """Write a result as NetCDF, for `load` or any other reader.

    Args:
        result: result of `compare`, `flss`, a study or `record`. Settings without a NetCDF type become JSON text.
        path: NetCDF file to write; an existing file is replaced.

    Raises:
        InputError: the result contains a value that NetCDF cannot store.
    """
    return write_netcdf(result.assign_attrs(attributes(result.attrs)), path)


def attributes(settings: Mapping[Any, Any]) -> dict[str, Any]:
    """Return settings as attributes for NetCDF: texts, numbers and arrays stay, other values become JSON text."""

    def plain(value: Any) -> Any:
        value = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, str | float | np.ndarray) or (type(value) is int and abs(value) < 2**63):
            return value
        return json.dumps(value, default=str)

    return {str(name): plain(value) for name, value in settings.items()}


def settings(result: "xr.Dataset") -> dict[str, Any]:
    """Return the settings of a result: controllers, observation time, starts, seed, conditions.

    Args:
        result: result of `compare`, `flss` or a study, computed now or read from a file.

    Returns:
        Name -> number, text, list or dict; for example, `settings(result)["conditions"]["vp"]` is V_p.
    """
    return {str(name): value if name in TEXTS else _parsed(value) for name, value in result.attrs.items()}


def _parsed(attribute: Any) -> Any:
    if not isinstance(attribute, str):
        return attribute.tolist() if isinstance(attribute, np.generic | np.ndarray) else attribute
    try:
        return json.loads(attribute)
    except ValueError:
        return attribute


def save_figure(figure: "Figure", path: Path) -> Path:
    """Write a figure in the format of the path's suffix, without a date, so that equal figures are equal files."""
    undated: dict[str, Any] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with replacing(path) as part:
        figure.savefig(part, dpi=150, metadata=undated.get(path.suffix))
    return path


def json_text(value: Any) -> str:
    """Return a value as JSON text, with null for numbers that are not finite."""
    finite = json.loads(json.dumps(value, default=str), parse_constant=lambda _: None)
    return json.dumps(finite, indent=2)


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = (heads, ["---"] * len(heads), *rows)
    return ["| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines]


def save_manifest(command: Sequence[str], settings: Mapping[str, Any], files: Sequence[Path], path: Path) -> Path:
    """Write a manifest, which records how files were made: the command, its settings, versions, and the files' names.

    Args:
        command: arguments of the command line after `hexmj`.
        settings: settings of the results.
        files: files that the command wrote, in the manifest's folder or below it.
        path: file of the manifest.
    """
    names = [file.relative_to(path.parent).as_posix() for file in files]
    content = {"command": list(command), "settings": dict(settings), "versions": versions(), "files": names}
    return write_text(path, json_text(content) + "\n")


def versions() -> dict[str, str]:
    """Return the versions of hexmj, Python and the packages that change numbers, by name."""
    return {"hexmj": __version__, "python": platform.python_version()} | {name: version(name) for name in LIBRARIES}
