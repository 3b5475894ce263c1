"""For programs of tests that need no Dask, which xarray would import: half of the time that they take."""

import sys

sys.modules["dask"] = None  # pyright: ignore[reportArgumentType]
