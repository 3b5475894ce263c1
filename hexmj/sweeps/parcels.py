"""Cells as they are sent to workers: their settings, without what these have computed of files as they were."""

import pickle
from copyreg import dispatch_table
from io import BytesIO
from typing import Any

from hexmj.errors import InputError
from hexmj.sweeps.cells import Cell
from hexmj.sweeps.plain_settings import field_names, is_computed_once

_USUAL = {way: getattr(object, way) for way in ("__getstate__", "__reduce__", "__reduce_ex__")}
"""How objects are pickled that say nothing else."""


def pickled_cell(cell: Cell) -> bytes:
    """A cell for another process, which computes anew what `cached_property` holds.

    Raises:
        InputError: it cannot be pickled.
    """
    parcel = BytesIO()
    try:
        _WithoutMemory(parcel, pickle.HIGHEST_PROTOCOL).dump(cell)
    except Exception as error:
        raise InputError(f"{cell.name} cannot be sent to another process: {error}") from None
    return parcel.getvalue()


class _WithoutMemory(pickle.Pickler):
    """Leaves out of settings what they have computed once, unless their classes say how they are pickled."""

    def reducer_override(self, one: Any) -> Any:
        names, kind = field_names(one), type(one)
        if names is None or kind in dispatch_table or any(getattr(kind, way) is not _USUAL[way] for way in _USUAL):
            return NotImplemented
        match one.__reduce_ex__(pickle.HIGHEST_PROTOCOL):
            case (made, arguments, dict(state), *rest):
                kept = {name: it for name, it in state.items() if name in names or not is_computed_once(kind, name)}
                return made, arguments, kept, *rest
            case other:
                return other
