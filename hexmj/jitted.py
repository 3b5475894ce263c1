"""Compiled functions, kept from run to run while nothing that they are made of changes."""

import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])

njit: Any = numba.njit
"""Whose types tell not all of its options."""

SEAL = sha256().digest_size
"""Length of a checksum [bytes]."""

part = njit(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""A function that only compiled ones call, for Python would crash.  Without what that would call it by, it compiles in
half of the time."""

inlined = njit(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
"""The same, put into each of its callers."""


def jitted(function: Function) -> Function:
    """numba's `njit`, kept on the disk.

    By itself numba compiles anew after an edit of the function's own file alone; here also after one of what it takes
    from others, functions and constants, which are compiled into it.
    """
    made: Any = njit(cache=True, nogil=True, no_cfunc_wrapper=True)(function)
    if made is not function:  # as it is with NUMBA_DISABLE_JIT
        _stamp_when_asked(made._cache, function)
        _seal(made._cache._cache_file)
    return made


def _stamp_when_asked(cache: Any, function: Callable[..., Any]) -> None:
    """Let what a cache keeps tell all that is compiled into it, as soon as the whole module is there."""
    usual, load = cache._cache_file._source_stamp, cache.load_overload

    def load_overload(*asked: Any) -> Any:
        cache._cache_file._source_stamp = (*usual, sha256(_made_of(function).encode()).hexdigest())
        return load(*asked)

    cache.load_overload = load_overload


def _seal(files: Any) -> None:
    """Let each of a cache's files tell what it was compiled from and for, under a checksum.

    numba renews an index before the code, and numbers files from 1 again: where a full disk or a kill comes between, or
    two processes do so at once, an index names a file of other code.  Such a file, or a damaged one, is none.
    """
    usual_save, usual_load = files.save, files.load

    def write(name: str, sealed: bytes) -> None:
        with files._open_for_write(files._data_path(name)) as file:
            file.write(sealed)

    def read(name: str) -> bytes:
        return Path(files._data_path(name)).read_bytes()

    def save(key: Any, code: Any) -> None:
        told = files._dump((files._source_stamp, key, code))
        usual_save(key, sha256(told).digest() + told)

    def load(key: Any) -> Any:
        found = usual_load(key)
        if found is None or sha256(found[SEAL:]).digest() != found[:SEAL]:
            return None
        *told, code = pickle.loads(found[SEAL:])
        return code if told == [files._source_stamp, key] else None

    files._save_data, files._load_data, files.save, files.load = write, read, save, load


def _made_of(function: Callable[..., Any]) -> str:
    """The code of a function, and all that it looks up in its module: compiled functions, modules and constants."""
    code: Any = function.__code__
    names = [name for name in code.co_names if name != function.__name__]
    known = {name: function.__globals__[name] for name in names if name in function.__globals__}
    return repr((code.co_code, code.co_consts, code.co_names, [_told(one) for one in known.values()]))


def _told(one: Any) -> str:
    """Something that a function looks up, whatever path leads to a module and however NumPy prints numbers."""
    if hasattr(one, "py_func"):
        return _made_of(one.py_func)
    if isinstance(one, ModuleType):
        return one.__name__
    return repr((one.dtype.str, one.tolist()) if isinstance(one, np.generic | np.ndarray) else one)
