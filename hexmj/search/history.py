"""The course of a search: every candidate and its cost, in the order of their evaluation."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

STAGES = ("population", "simplex")

Asked = tuple[str, np.ndarray, np.ndarray]
"""A stage, some of its candidates, (candidate, parameter), and their costs, (candidate,)."""


def history(asked: Sequence[Asked], names: Sequence[str], minimised: str) -> "xr.Dataset":
    """Over `evaluation`, counted from 0: stage, candidate, cost (in words what is `minimised`), and the best so far,
    begun anew with each stage."""
    import xarray as xr

    stage = np.repeat([STAGES.index(name) for name, *_ in asked], [len(costs) for *_, costs in asked])
    cost = np.concatenate([costs for *_, costs in asked])
    best = cost.copy()
    for one in range(len(STAGES)):
        best[stage == one] = np.minimum.accumulate(cost[stage == one])
    candidates = np.concatenate([candidates for _, candidates, _ in asked])
    flags = {"flag_values": list(range(len(STAGES))), "flag_meanings": " ".join(STAGES)}
    return xr.Dataset(
        {
            "stage": ("evaluation", stage, flags),
            "candidate": (("evaluation", "parameter"), candidates, {"long_name": "parameters"}),
            "cost": ("evaluation", cost, {"units": "1", "long_name": minimised}),
            "best": ("evaluation", best, {"units": "1", "long_name": f"least so far of the stage: {minimised}"}),
        },
        coords={"evaluation": np.arange(len(cost)), "parameter": list(names)},
        attrs={"study": "search", "title": minimised},
    )
