"""The course of a search: every candidate and its cost, in the order of their evaluation."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

STAGES = ("population", "simplex")


class History:
    """What a search has asked for, stage by stage."""

    def __init__(self) -> None:
        self._asked: list[tuple[str, np.ndarray, np.ndarray]] = []

    def add(self, stage: str, candidates: np.ndarray, costs: np.ndarray) -> None:
        """Candidates of a stage, (candidate, parameter), and their costs, (candidate,)."""
        self._asked.append((stage, candidates.copy(), costs.copy()))

    def dataset(self, names: Sequence[str], minimised: str) -> "xr.Dataset":
        """Over `evaluation`, counted from 0: stage, candidate, cost, the best so far, begun anew with each stage.

        Args:
            names: of the parameters.
            minimised: what a cost is, in words.
        """
        import xarray as xr

        stage = np.repeat([STAGES.index(name) for name, *_ in self._asked], [len(costs) for *_, costs in self._asked])
        cost = np.concatenate([costs for *_, costs in self._asked])
        best = cost.copy()
        for one in range(len(STAGES)):
            best[stage == one] = np.minimum.accumulate(cost[stage == one])
        candidates = np.concatenate([candidates for _, candidates, _ in self._asked])
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
