"""Which parts of a result can be drawn: none along an axis over which its numbers were taken."""

from typing import TYPE_CHECKING

from hexmj.attributes import settings
from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


def check_starts(result: "xr.Dataset", told: int | None = None) -> None:
    """Refuse a part of the starts, since frequencies and titles are those of all.

    Args:
        result: over start, or without that axis.
        told: of how many starts its numbers are; as its settings say unless given.

    Raises:
        InputError: it holds fewer, or more.
    """
    given = settings(result)
    check_whole(result, "start", told or given.get("starts") or given["n_starts"])


def check_whole(result: "xr.Dataset", axis: str, size: int) -> None:
    """Refuse a part along an axis over which numbers were taken; nothing is said of a result without it.

    Args:
        result: of any study.
        axis: name of the axis.
        size: how many values it had then.

    Raises:
        InputError: it has fewer now, or more.
    """
    if (found := result.sizes.get(axis, size)) != size:
        raise InputError(f"{found} of {size} along the axis {axis}; expected all, since the numbers are those of all")
