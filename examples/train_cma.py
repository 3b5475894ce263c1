"""Learn reflexes with CMA-ES (`pip install ".[gym,search]"`): 15 weights that prevent early falls of LDVS.

In each generation, all candidates walk the same new starts in one vector environment. `python examples/train_cma.py`
takes some minutes and writes the weights into `reflexes.toml`. Compare the reflexes with other controllers:
`hexmj league --controller examples/train_cma.py:REFLEXES ldvs`.
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
VELOCITY, DURATION = 0.6, 40.0  # V_r, and the observation time `start` [time units]
MOST_LOST = 0.07  # greatest share of tips out of reach
POPULATION, STARTS, GENERATIONS = 12, 32, 25
FRESH = 200  # starts of the final comparison

LEFT = np.array([1, 1, 1, -1, -1, -1])  # +1 on the left
AHEAD = np.array([1, 0, -1, 1, 0, -1])  # +1 in front


@dataclass(frozen=True)
class Reflexes:
    """Reflexes that are the same in every leg: constant, in swing, and as the body leans and tips towards the leg."""

    weights: tuple[tuple[float, ...], ...] = 3 * (5 * (0.0,),)
    """Weights for forward, outward and up: constant, in swing, lean aside, lean ahead, tipping ahead."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Return the offsets of the tips, (n, leg * axis)."""
        return offsets(np.array(self.weights)[None], felt)


def offsets(weights: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Return offsets, (n, leg * axis), for weights, (n or 1, axis, cause)."""
    tilt, turning, constant = felt[:, TILT], felt[:, TURNING], np.ones((len(felt), 6))
    causes = [constant, 1 - felt[:, STANCE], tilt[:, 1:] * LEFT, tilt[:, :1] * AHEAD]
    causes.append(turning[:, 1:2] * AHEAD)
    moved = np.einsum("nar,rnl->nla", np.broadcast_to(weights, (len(felt), 3, 5)), causes)
    moved[:, :, 1] *= LEFT
    return np.clip(moved, -1, 1).reshape(-1, 18)


def costs(candidates: np.ndarray, seed: int) -> np.ndarray:
    """Return the cost of every candidate, (candidate, 15): its falls on the same starts, less a little for speed.

    An insect with more than `MOST_LOST` of its tips out of reach counts as fallen.
    """
    from hexmj.environments.gym import StickInsects  # the learned controller walks without Gymnasium

    count = len(candidates) * STARTS
    walking = StickInsects(count, actions="tips", velocity=VELOCITY, duration=DURATION, autoreset_mode="Disabled")
    seen, _ = walking.reset(seed=[seed + i for i in range(STARTS)] * len(candidates))
    weights = candidates.reshape(-1, 3, 5).repeat(STARTS, axis=0)
    gained, walked, lost = np.zeros((3, count))
    fell, over = np.zeros((2, count), dtype=bool)
    while not (fell | over).all():
        seen, reward, falls, ends, _ = walking.step(offsets(weights, felt_in(seen)))
        walks = ~(fell | over)
        walked, lost = walked + walks, lost + walks * seen["out_of_reach"].mean(axis=1) / walking.task.substeps
        gained, fell, over = gained + reward, fell | falls, over | ends
    share, speed = lost / walked, gained * hexmj.Stride().dt / DURATION
    return ((fell | (share > MOST_LOST)) + 2 * share - 0.1 * speed).reshape(-1, STARTS).mean(axis=1)


def main() -> None:
    """Search the weights, write them, and compare them with LDVS."""
    began, search = time.monotonic(), CMA(mean=np.zeros(15), sigma=0.1, population_size=POPULATION, seed=1)
    for generation in range(GENERATIONS):
        candidates = np.array([search.ask() for _ in range(POPULATION)])
        cost = costs(candidates, seed=1000 * (generation + 1))
        search.tell(list(zip(candidates, cost.tolist(), strict=True)))
        print(f"generation {generation + 1}: cost {cost.mean():.3f}, best {cost.min():.3f}", flush=True)
    rows = [", ".join(f"{number:.3f}" for number in row) for row in search.mean.reshape(3, 5)]
    FOUND.write_text("weights = [\n" + "".join(f"    [{row}],\n" for row in rows) + "]\n", encoding="utf-8")
    print(f"{FOUND} after {time.monotonic() - began:.0f} s")
    both = {"ldvs": hexmj.LDVS, "reflexes": found()}
    result = hexmj.compare(both, [VELOCITY], n_starts=FRESH, observation_time="start", seed=77)
    for name, falls in zip(both, result.physical.values[:, 0], strict=True):
        print(f"{name}: physical FLSS {falls:.2f} at V = {VELOCITY:g}, {FRESH} fresh starts")


def found() -> WithOffsets:
    """Return LDVS with the reflexes from the file."""
    weights = tomllib.loads(FOUND.read_text(encoding="utf-8"))["weights"]
    return WithOffsets(Reflexes(tuple(map(tuple, weights))), name="reflexes")


if FOUND.exists():
    REFLEXES = found()

if __name__ == "__main__":
    main()
