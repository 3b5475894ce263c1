"""Results on disk: NetCDF, figures and texts, each written whole or not at all."""

import io
import json
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.checks import TILDE, path_of, stands_for_home, typed
from hexmj.errors import InputError
from hexmj.storage import netcdf
from hexmj.storage.attributes import attributes
from hexmj.storage.files import read_sealed, remove_leftovers, sealed, try_writing, write_whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def load(path: Path | str) -> "xr.Dataset":
    """Read a result that a command or `save` wrote; it is the same as when it was fresh.

    Args:
        path: such as "results/compare/comparison.nc".

    Raises:
        InputError: it cannot be read, is damaged, or was written by another program.
    """
    path = path_of(path)
    content = read_sealed(path)
    return netcdf.decode(
        content, f"{path} is damaged, or no result that hexmj wrote; `xarray.load_dataset` reads what others wrote"
    )


def save(result: "xr.Dataset", path: Path | str) -> Path:
    """Write a result as NetCDF, for `load` or any other reader; the file appears whole or not at all.

    Args:
        result: of `compare`, `flss`, any study or recording.
        path: of the file; what stands there is overwritten.

    Raises:
        InputError: it is no dataset, holds what NetCDF cannot, or cannot be written.
    """
    import xarray as xr

    return write_whole(path_of(path), sealed(netcdf.encode(typed("result", result, xr.Dataset))))


def results_folder(path: Path, names: Sequence[str]) -> Path:
    """The folder for results, if the files `names` can be written to it; it is made when the first one is.

    What killed processes left there half written is removed.

    Raises:
        InputError: the path or a name in it is taken by something else, cannot be written to, or looks like a file's.
    """
    if stands_for_home(path):
        raise InputError(f"--out {path}: {TILDE}")
    try:
        nearest = next(one for one in (path, *path.absolute().parents) if os.path.lexists(one))
        if not nearest.is_dir():
            what = "is a file" if nearest.exists() else "is a link to nothing"
            raise InputError(f"--out {path}: {nearest} {what}; expected a folder")
        if nearest != path and path.suffix.lower() in {Path(name).suffix for name in names} - {""}:
            raise InputError(f"--out {path} is called like a file; expected a folder, which {names[0]} is put into")
        missing = path.absolute().relative_to(nearest.absolute()).parts
        if os.pardir in missing:
            raise InputError(f"--out {path} leads through {missing[0]}, which is not there; expected a folder")
        for name in missing:  # that the system may not take
            with suppress(FileNotFoundError):
                os.lstat(nearest / name)
        try_writing(nearest)
        there = [name for name in names if (path / name).exists()]
        taken = [name for name in there if not (path / name).is_file()]
    except OSError as error:
        raise InputError(f"--out {path} cannot be written to: {error.strerror}; expected a folder that can") from None
    if taken:
        what = "folder" if (path / taken[0]).is_dir() else "pipe or a device"
        raise InputError(f"--out {path}: {taken[0]} is a {what} there; expected a file or nothing")
    if kept := [name for name in there if not os.access(path / name, os.W_OK)]:
        raise InputError(f"--out {path}: {kept[0]} may only be read; expected a file that may be written, or nothing")
    remove_leftovers(path)
    return path


def save_dataset(data: "xr.Dataset", path: Path) -> Path:
    """Write a dataset as NetCDF; settings that NetCDF has no type for become JSON text."""
    plain = data.copy()
    plain.attrs = attributes({str(key): value for key, value in data.attrs.items()})
    return write_whole(path, sealed(netcdf.encode(plain)))


def save_figure(figure: "Figure", path: Path, **how: Any) -> Path:
    """Write a figure in the format that the name's ending tells; `how` as of `Figure.savefig`."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], **how)
    return write_whole(path, drawn.getvalue())


def save_text(text: str, path: Path) -> Path:
    """Write a text in UTF-8."""
    return write_whole(path, text.encode())


def json_text(value: Any) -> str:
    """JSON with null for numbers that are not finite."""
    finite = json.loads(json.dumps(value, default=str), parse_constant=lambda _: None)
    return json.dumps(finite, indent=2)
