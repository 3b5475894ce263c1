"""The history of a search is also its state: what is replayed from it need not be evaluated again."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.results import save_dataset

if TYPE_CHECKING:
    import xarray as xr

Costs = Callable[[np.ndarray], np.ndarray]
"""(candidate, parameter) -> (candidate,)."""

STAGES = ("population", "simplex")

EVERY = 1.0
"""Least time between two savings [s]; a killed search loses no more than this and one generation."""


class History:
    """Every candidate and its cost, in the order of their evaluation, kept in a NetCDF file."""

    def __init__(self, path: Path | None, names: Sequence[str], settings: dict[str, Any]) -> None:
        """Begin with what the file holds, if there is one.

        Args:
            path: NetCDF file; None keeps the history in memory only.
            names: of the parameters.
            settings: all that determines the search; a file of another search is refused.

        Raises:
            InputError: the file is damaged, or of another search; it stays as it is.
        """
        self._path, self._names, self._saved_at = path, list(names), -math.inf
        self._settings = json.dumps(settings, sort_keys=True)
        self._stage: list[int] = []
        self._candidate = np.empty((0, len(names)))
        self._cost = np.empty(0)
        if path and path.exists():
            self._load(path)
        self.known = len(self._stage)
        """Evaluations that the file held."""
        self._done = 0

    def recorded(self, stage: str, costs: Costs) -> Costs:
        """The same costs, replayed as far as they are known and recorded from there on."""

        def look_up(candidates: np.ndarray) -> np.ndarray:
            first, last = self._done, self._done + len(candidates)
            held = min(last, len(self._stage)) - first
            expected = [STAGES.index(stage)] * held
            if self._stage[first:last] != expected or (self._candidate[first:last] != candidates[:held]).any():
                raise InputError(
                    f"{self._path}: evaluation {first} is not what this search asks for; other versions of the packages"
                    " made it, so repeat with those, or give another --out"
                )
            if held < len(candidates):
                new = costs(candidates[held:])
                self._stage += [STAGES.index(stage)] * len(new)
                self._candidate = np.concatenate([self._candidate, candidates[held:]])
                self._cost = np.concatenate([self._cost, new])
                if time.monotonic() - self._saved_at > EVERY:
                    self.save()
            self._done = last
            return self._cost[first:last].copy()

        return look_up

    def dataset(self) -> "xr.Dataset":
        """Over `evaluation`: candidate, cost, and the best cost so far, which begins anew with each stage."""
        import xarray as xr

        stage, best = np.array(self._stage, dtype=int), self._cost.copy()
        for one in range(len(STAGES)):
            best[stage == one] = np.minimum.accumulate(self._cost[stage == one])
        flags = {"flag_values": list(range(len(STAGES))), "flag_meanings": " ".join(STAGES)}
        return xr.Dataset(
            {
                "stage": ("evaluation", stage, flags),
                "candidate": (("evaluation", "parameter"), self._candidate, {"long_name": "parameters (Appendix A)"}),
                "cost": ("evaluation", self._cost, {"units": "1", "long_name": "cost function G"}),
                "best": ("evaluation", best, {"units": "1", "long_name": "least cost so far of the stage"}),
            },
            coords={"parameter": self._names},
            attrs={"settings": self._settings, "digest": self._digest(self._settings)},
        )

    def save(self) -> None:
        """Write the file whole, if anything is new."""
        if self._path and len(self._stage) > self.known:
            save_dataset(self.dataset(), self._path)
            self._saved_at = time.monotonic()

    def _load(self, path: Path) -> None:
        import xarray as xr

        try:
            data = xr.load_dataset(path, engine="h5netcdf")
            settings, digest = str(data.attrs["settings"]), data.attrs["digest"]
            self._stage = data.stage.values.astype(int).tolist()
            self._candidate, self._cost = data.candidate.values, data.cost.values
        except (OSError, ValueError, KeyError, RuntimeError, AttributeError, TypeError):
            digest = settings = ""
        if digest != self._digest(settings):
            raise InputError(f"{path} is damaged, or no history of a search; move it away, or give another --out")
        if settings != self._settings:
            raise InputError(
                f"{path} is of another search: {_difference(settings, self._settings)}; give another --out"
            )

    def _digest(self, settings: str) -> str:
        stage = np.array(self._stage, dtype=np.int64)
        parts = settings.encode(), stage.tobytes(), self._candidate.tobytes(), self._cost.tobytes()
        return hashlib.sha256(b"".join(parts)).hexdigest()


def _difference(theirs: str, ours: str) -> str:
    """The first setting in which two searches differ."""
    a, b = _flat(json.loads(theirs)), _flat(json.loads(ours))
    key = next(key for key in {**b, **a} if a.get(key) != b.get(key))
    return f"{key} is {a.get(key)} there and {b.get(key)} here"


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Nested settings by their dotted names."""
    if not isinstance(value, dict):
        return {name: value}
    return {key: leaf for k, v in value.items() for key, leaf in _flat(v, f"{name}.{k}".lstrip(".")).items()}
