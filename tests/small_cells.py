"""Small cells for the tests of sweeps."""

import os
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from hexmj.progress import Progress
from hexmj.sweep import Cell

ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(str(folder) for folder in Path(__file__).parents[:2])}
"""For processes that import this module and hexmj."""


@dataclass(frozen=True)
class Wave:
    """A setting with a method that is a cell's function."""

    slope: float = 1.0
    values: np.ndarray = field(default_factory=lambda: np.arange(3.0))

    def rows(self, shift: float) -> xr.Dataset:
        return xr.Dataset({"y": ("x", self.slope * self.values + shift)})


def odd_bits(seed: int, size: int = 4) -> xr.Dataset:
    """Return numbers whose bits are easily lost: signs of NaN and 0, subnormals, bool, text, no rows."""
    draw = np.random.default_rng(seed).standard_normal(size)
    special = np.array([-np.nan, np.nan, -0.0, 5e-324, np.inf, 0.1 + 0.2])
    return xr.Dataset(
        {
            "draw": ("start", draw, {"units": "s"}),
            "special": ("bit", np.copysign(special, [-1, 1, -1, 1, -1, 1])),
            "fell": ("start", draw > 0),
            "count": ("start", np.arange(size, dtype=np.int8)),
            "none": ("nothing", np.empty(0)),
        },
        {"leg": ["R1", "L1"]},
        {"unit": "none"},
    )


def counted(log: str, number: int, wait: float = 0.0, fails: bool = False) -> xr.Dataset:
    """Write into a log that the cell was computed."""
    time.sleep(wait)
    if fails:
        raise ValueError(f"cell {number} fails")
    with Path(log, "calls").open("a") as file:
        file.write(f"{number}\n")
    return xr.Dataset({"number": float(number)})


NOW = [0.0]
"""Time of a clock that only `reporting` moves [s]."""


def reporting(seed: int, seconds: float = 0.0, threads: int | None = 7, progress: Progress | None = None) -> xr.Dataset:
    """Let time pass, report progress in quarters, and return the number of threads."""
    for _ in range(4):
        NOW[0] += seconds / 4
        if progress:
            progress(0.25)
    return xr.Dataset({"threads": -1 if threads is None else threads, "seed": seed})


def steps(controller: object, n: int) -> xr.Dataset:
    return xr.Dataset({"steps": ("step", controller.steps(n))})  # pyright: ignore[reportAttributeAccessIssue]


def odd_cells(n: int = 6) -> list[Cell]:
    return [Cell(f"seed {seed}", odd_bits, {"seed": seed}) for seed in range(n)]


def counted_cells(log: Path, n: int = 6, **settings: object) -> list[Cell]:
    return [Cell(f"number {i}", counted, {"log": str(log), "number": i} | settings) for i in range(n)]


def assert_same_bits(first: list[xr.Dataset], second: list[xr.Dataset]) -> None:
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert one.identical(other) and one.attrs == other.attrs
        for name in one.variables:
            assert one[name].dtype == other[name].dtype
            assert one[name].dtype == object or one[name].values.tobytes() == other[name].values.tobytes()
