"""Decorators for compiled functions, whose machine code is cached on disk."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from hexmj.version import __version__

Function = TypeVar("Function", bound=Callable[..., Any])

njit: Any = numba.njit  # numba's type annotations lack some options

part = njit(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorator of a function that only compiled functions can call, not Python; it compiles in half the time."""

inlined = njit(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
"""Decorator of a function that only compiled functions can call; it is inlined into each of its callers."""


def jitted(function: Function) -> Function:
    """Compile a function with numba and cache it on disk.

    numba discards cached code when the file of the function changes. This decorator makes numba discard it also when
    the version of hexmj changes, or the file of a compiled function that the function's module uses.
    """
    compiled: Any = njit(cache=True, nogil=True, no_cfunc_wrapper=True)(function)
    if compiled is not function:  # with NUMBA_DISABLE_JIT numba returns the function itself
        cache_file = compiled._cache._cache_file
        stamps = sorted((file, Path(file).stat().st_mtime) for file in _files(function, set()))
        cache_file._source_stamp = (cache_file._source_stamp, __version__, *stamps)
    return compiled


def _files(function: Callable[..., Any], found: set[str]) -> set[str]:
    """Add to `found` the files of a function and of all compiled functions that its module uses; return `found`."""
    found.add(function.__code__.co_filename)
    for value in function.__globals__.values():
        inner = getattr(value, "py_func", None)
        if inner and inner.__code__.co_filename not in found:
            _files(inner, found)
    return found
