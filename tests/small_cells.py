"""Small cells for the tests of sweeps; a user's file, and where processes find both."""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from hexmj.progress import Progress
from hexmj.sweep import Cell

PATHS = ".", *(str(folder) for folder in Path(__file__).parents[:2])
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(PATHS)}
WITHOUT_DASK = os.environ | {"PYTHONPATH": os.pathsep.join([*PATHS, str(Path(__file__).with_name("without_dask"))])}

BODY = '<mujoco><worldbody><body><geom size="1" mass="{}"/></body></worldbody></mujoco>'
"""An MJCF of one mass."""

MINE = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Tripod:
    rate: float = 1.0

    def steps(self, n):
        return [self.rate * i for i in range(n)]
"""


@dataclass(frozen=True)
class Wave:
    """A setting with a method that can be a cell's function."""

    slope: float = 1.0
    values: np.ndarray = field(default_factory=lambda: np.arange(3.0))

    def rows(self, shift: float) -> xr.Dataset:
        return xr.Dataset({"y": ("x", self.slope * self.values + shift)})


class OfALeg(Exception):
    """Cannot be pickled, nor unpickled, as those cannot that make a sentence of what they are given."""

    def __init__(self, leg: int, why: str) -> None:
        super().__init__(f"leg {leg} {why}")
        self.why = lambda: why


def slips(leg: int) -> xr.Dataset:
    raise OfALeg(leg, "slips")


def odd_bits(seed: int, size: int = 4) -> xr.Dataset:
    """Numbers whose bits are easily lost on the way: signs of NaN and 0, subnormals, bool, text, no rows at all."""
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
        {"told": "as it was"},
    )


def counted(log: str, number: int, wait: float = 0.0, fails: bool = False) -> xr.Dataset:
    """Writes into a log that it was computed."""
    time.sleep(wait)
    if fails:
        raise ValueError(f"cell {number} fails")
    with Path(log, "calls").open("a") as file:
        file.write(f"{number}\n")
    return xr.Dataset({"number": float(number)})


def told_how(seed: int, threads: int | None = 7, progress: Progress | None = None) -> xr.Dataset:
    for _ in range(3 if progress else 0):
        assert progress
        progress(0.25)
    return xr.Dataset({"threads": -1 if threads is None else threads, "seed": seed})


def of_object(controller: object, n: int) -> xr.Dataset:
    return xr.Dataset({"steps": ("step", controller.steps(n))})  # pyright: ignore[reportAttributeAccessIssue]


def numbers(seed: int) -> xr.Dataset:
    return xr.Dataset({"x": ("n", np.random.default_rng(seed).standard_normal(3))})


def moves(folder: str, to: str, seed: int) -> xr.Dataset:
    """A cell in the middle of which the folder is renamed, by a person or by another program."""
    if seed:
        Path(folder).rename(to)
    return numbers(seed)


def squares(rows: np.ndarray) -> np.ndarray:
    return (rows**2).sum(axis=1)


def odd_cells(n: int = 6) -> list[Cell]:
    return [Cell(f"seed {seed}", odd_bits, {"seed": seed}) for seed in range(n)]


def counted_cells(log: Path, n: int = 6, **settings: object) -> list[Cell]:
    return [Cell(f"number {i}", counted, {"log": str(log), "number": i} | settings) for i in range(n)]


def assert_same_bits(these: Sequence[xr.Dataset], those: Sequence[xr.Dataset]) -> None:
    assert len(these) == len(those)
    for one, other in zip(these, those, strict=True):
        assert one.identical(other) and one.attrs == other.attrs
        for name in one.variables:
            assert one[name].dtype == other[name].dtype
            assert one[name].dtype == object or one[name].values.tobytes() == other[name].values.tobytes()
