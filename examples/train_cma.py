"""Reflexes learned by CMA-ES (`pip install ".[gym,search]"`): 15 numbers that keep LDVS from falling as it sets off.

Every generation all candidates walk the same fresh starts, each start in an insect of its own in one vector
environment.  `python examples/train_cma.py` takes some minutes and writes what it found beside itself; `hexmj league
--controllers examples/train_cma.py:REFLEXES ldvs` sets it among the others.
"""

import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cmaes import CMA

import hexmj
from hexmj.environments.learned import STANCE, TILT, TURNING, WithOffsets, felt_in

FOUND = Path(__file__).with_name("reflexes.toml")
VELOCITY, WINDOW = 0.6, 40.0  # V_r, and the observation time `start` [time units]
MOST_LOST = 0.07
POPULATION, STARTS, GENERATIONS = 12, 32, 25

LEFT = np.array([1, 1, 1, -1, -1, -1])  # +1 on the left
AHEAD = np.array([1, 0, -1, 1, 0, -1])  # +1 in front


@dataclass(frozen=True)
class Reflexes:
    """The same in every leg: what it does as it stands and swings, and as the body leans and turns towards it."""

    weights: tuple[tuple[float, ...], ...] = 3 * (5 * (0.0,),)
    """Of forward, outward and up: always, in swing, by lean aside and ahead, by tipping ahead; each towards the leg."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Offsets of the tips, (n, leg * axis)."""
        return offsets(np.array(self.weights)[None], felt)


def offsets(weights: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Offsets, (n, leg * axis), by weights, (n or 1, axis, reason)."""
    tilt, turning, one = felt[:, TILT], felt[:, TURNING], np.ones((len(felt), 6))
    reasons = [one, 1 - felt[:, STANCE], tilt[:, 1:] * LEFT, tilt[:, :1] * AHEAD]
    reasons.append(turning[:, 1:2] * AHEAD)
    moved = np.einsum("nar,rnl->nla", np.broadcast_to(weights, (len(felt), 3, 5)), reasons)
    moved[:, :, 1] *= LEFT
    return np.clip(moved, -1, 1).reshape(-1, 18)


def costs(candidates: np.ndarray, seed: int) -> np.ndarray:
    """Share of falls of every candidate, (candidate, 15), on the same starts; of two alike the one that is faster.

    An insect of whose tips more than `MOST_LOST` are out of reach counts as fallen; a tenth would be no walk.
    """
    from hexmj.environments.vector import StickInsects  # what was learned walks without Gymnasium

    count = len(candidates) * STARTS
    walking = StickInsects(count, actions="tips", velocity=VELOCITY, duration=WINDOW, autoreset_mode="Disabled")
    seen, _ = walking.reset(seed=[seed + i for i in range(STARTS)] * len(candidates))
    weights = candidates.reshape(-1, 3, 5).repeat(STARTS, axis=0)
    gained, walked, lost = np.zeros((3, count))
    fell, over = np.zeros((2, count), dtype=bool)
    while not (fell | over).all():
        seen, reward, falls, ends, _ = walking.step(offsets(weights, felt_in(seen)))
        walks = ~(fell | over)
        walked, lost = walked + walks, lost + walks * seen["out_of_reach"].mean(axis=1) / walking.task.substeps
        gained, fell, over = gained + reward, fell | falls, over | ends
    share, speed = lost / walked, gained * hexmj.Stride().dt / WINDOW
    return ((fell | (share > MOST_LOST)) + 2 * share - 0.1 * speed).reshape(-1, STARTS).mean(axis=1)


def main() -> None:
    began, search = time.monotonic(), CMA(mean=np.zeros(15), sigma=0.1, population_size=POPULATION, seed=1)
    for generation in range(GENERATIONS):
        candidates = np.array([search.ask() for _ in range(POPULATION)])
        cost = costs(candidates, seed=1000 * (generation + 1))
        search.tell(list(zip(candidates, cost.tolist(), strict=True)))
        print(f"generation {generation + 1}: cost {cost.mean():.3f}, best {cost.min():.3f}", flush=True)
    rows = [", ".join(f"{number:.3f}" for number in row) for row in search.mean.reshape(3, 5)]
    FOUND.write_text("weights = [\n" + "".join(f"    [{row}],\n" for row in rows) + "]\n", encoding="utf-8")
    print(f"{FOUND} after {time.monotonic() - began:.0f} s")
    result = hexmj.compare(
        {"ldvs": hexmj.LDVS, "reflexes": found()}, [VELOCITY], n_starts=200, observation_time="start", seed=77
    )
    for name, falls in zip(("ldvs", "reflexes"), result.physical.values[:, 0], strict=True):
        print(f"{name}: physical FLSS of the start at V = {VELOCITY:g} is {falls:.2f} of 200 fresh starts")


def found() -> WithOffsets:
    """LDVS with the reflexes that were found."""
    weights = tomllib.loads(FOUND.read_text(encoding="utf-8"))["weights"]
    return WithOffsets(Reflexes(tuple(map(tuple, weights))), name="reflexes")


if FOUND.exists():
    REFLEXES = found()

if __name__ == "__main__":
    main()
