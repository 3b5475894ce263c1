"""Offsets to LDVS's tips learned by PPO of stable-baselines3 (`pip install ".[rl]"`), so that fewer insects fall.

The policy is a small network; what was learned is written as numbers, so that it walks without stable-baselines3:
`hexmj league --controllers examples/train_ppo.py:NETWORK ldvs`.
"""

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hexmj
from hexmj.environments.learned import FELT, WithOffsets

FOUND = Path(__file__).with_name("network.json")
VELOCITY, WINDOW = 0.6, 40.0  # V_r, and the window `start` [time units]
INSECTS, STEPS, HIDDEN = 64, 300_000, 32
COARSE = 0.5  # time step of the plan [time units]: an action lasts 6.25 ms at V_p = 80 mm/s
QUIET = 0.2  # size of the first actions: loud ones shake the insect off its feet
MOST_FELT = 10.0


@dataclass(frozen=True)
class Network:
    """Layers of tanh, the last one linear; without any no offsets."""

    layers: tuple[tuple[tuple[tuple[float, ...], ...], tuple[float, ...]], ...] = ()
    """Weights and biases of each."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Offsets of the tips, (n, leg * axis)."""
        now = np.clip(felt, -MOST_FELT, MOST_FELT)
        for weights, biases in self.layers[:-1]:
            now = np.tanh(now @ np.array(weights).T + np.array(biases))
        for weights, biases in self.layers[-1:]:
            return now @ np.array(weights).T + np.array(biases)
        return np.zeros((len(felt), 18))


def main() -> None:
    from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.vec_env import VecNormalize  # pyright: ignore[reportMissingImports]

    from hexmj.environments.stable_baselines import FeltInsects

    began, insects = (
        time.monotonic(),
        FeltInsects(INSECTS, velocity=VELOCITY, duration=WINDOW, stride=hexmj.Stride(dt=COARSE)),
    )
    net: dict = {"net_arch": [HIDDEN, HIDDEN], "log_std_init": float(np.log(QUIET))}
    agent = PPO(
        "MlpPolicy", VecNormalize(insects, norm_obs=False, gamma=0.98), policy_kwargs=net,
        n_steps=80, batch_size=1024, n_epochs=10, gamma=0.98,
        learning_rate=1e-3, seed=1, device="cpu",
    )  # fmt: skip
    agent.learn(STEPS)
    policy = agent.policy
    layers = [one for one in policy.mlp_extractor.policy_net if hasattr(one, "weight")] + [policy.action_net]
    kept = [[one.weight.detach().numpy().round(4).tolist(), one.bias.detach().numpy().tolist()] for one in layers]
    FOUND.write_text(json.dumps(kept), encoding="utf-8")
    print(f"{FOUND.name} after {time.monotonic() - began:.0f} s, {FELT} numbers felt")
    result = hexmj.compare({"ldvs": hexmj.LDVS, "network": found()}, [VELOCITY], n_starts=200, window="start", seed=77)
    for name, falls in zip(("ldvs", "network"), result.physical.values[:, 0], strict=True):
        print(f"{name}: physical FLSS of the start at V = {VELOCITY:g} is {falls:.2f} of 200 fresh starts")


def found() -> WithOffsets:
    """LDVS with the network that was found."""
    kept = json.loads(FOUND.read_text(encoding="utf-8")) if FOUND.exists() else []
    layers = tuple((tuple(map(tuple, weights)), tuple(biases)) for weights, biases in kept)
    return WithOffsets(Network(layers), name="network")


NETWORK = found()

if __name__ == "__main__":
    main()
