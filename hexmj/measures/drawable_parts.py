"""Which parts of results, and results joined, can be drawn or told in tables: no part along an axis over which numbers
were taken, and none of other walks than the settings tell."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from hexmj.errors import InputError
from hexmj.io import settings
from hexmj.timing import Acceleration, Stride, observation_duration

if TYPE_CHECKING:
    import xarray as xr

COUNTED = "start", "case", "row", "evaluation"
"""Axes of results that only count; any other has values or names."""


def check_axes(result: "xr.Dataset") -> None:
    """Refuse a result of one velocity without its axis, along which all is drawn, or one whose axis lost its values.

    Raises:
        InputError: with the name of the first one.
    """
    gone = [name for name, one in result.coords.items() if (name == "velocity" and not one.ndim) or not one.size]
    if gone:
        raise InputError(f"a result without the axis {gone[0]}; expected all of them, as of isel({gone[0]}=[0])")
    bare = [name for name in result.sizes if name not in (*COUNTED, *result.coords)]
    if bare:
        raise InputError(f"a result without the values of its axis {bare[0]}; expected the result as it was computed")


def check_observation_time(result: "xr.Dataset") -> None:
    """Refuse observation times that are not those of the observation time in the settings, as of results that were joined.

    Nothing is said of a result without such times or settings, nor of variants, whose strides are their own.

    Raises:
        InputError: with the first time that differs.
    """
    told = settings(result)
    known = {"observation_time", "stride", "acceleration"} <= told.keys()
    if "duration" not in result.variables or not known or "variant" in result.duration.dims:
        return
    stride = Stride(**{name: value for name, value in told["stride"].items() if name != "geometry"})
    acceleration = Acceleration(**told["acceleration"]) if told["acceleration"] else None
    times = observation_duration(told["observation_time"], result.velocity.values, stride, acceleration)
    walked = result.duration.transpose(..., "velocity").values
    if (odd := walked[~np.isclose(walked, times)]).size:
        raise InputError(
            f"a result with the observation time {told['observation_time']} in its settings, but with walks of {odd[0]:g} time units;"
            ' expected one observation time, stride and acceleration, or results joined with combine_attrs="drop_conflicts"'
        )


@contextmanager
def what_parts_may_lack(result: "xr.Dataset", cannot: str) -> Iterator[None]:
    """Refuse in one sentence whatever the block does not find in a part of a result, and say what then `cannot` be
    done, such as "the figure cannot be drawn".

    Raises:
        InputError: in place of the errors of Python, NumPy and xarray.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        sizes = ", ".join(f"{name} {size}" for name, size in result.sizes.items())
        single = ", ".join(str(name) for name, one in result.coords.items() if not one.ndim)
        told = f"{error!r:.200}" + (f"; of one {single} without an axis" if single else "")
        wanted = ", or parts that keep all axes, as of isel(...=[0])" if single else ""
        raise InputError(
            f"{cannot} of this part of a result, {sizes} ({told}); expected the result as it was computed{wanted}"
        ) from error


def check_starts(result: "xr.Dataset", told: int | None = None) -> None:
    """Refuse a part of the starts, since frequencies and titles are those of all: as many as `told`, or as its settings
    say; nothing is said of a result without that axis.

    Raises:
        InputError: it holds fewer, or more.
    """
    given = settings(result)
    if size := told or given.get("starts") or given.get("n_starts"):  # dropped where results of several were joined
        check_whole(result, "start", size)


def check_whole(result: "xr.Dataset", axis: str, size: int) -> None:
    """Refuse a part along an axis over which numbers were taken; nothing is said of a result without it.

    Raises:
        InputError: it has fewer values than it had then, or more.
    """
    if (found := result.sizes.get(axis, size)) != size:
        raise InputError(f"{found} of {size} along the axis {axis}; expected all, since the numbers are those of all")
