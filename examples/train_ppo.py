"""Learn reflexes that keep LDVS upright, with PPO of stable-baselines3 (`pip install ".[rl]"`).

An action sets four gains, the same in every leg, for 10 time units. The reflexes act at every step.
`python examples/train_ppo.py` writes the gains into `righting.json`. The learned controller does not need
stable-baselines3: `hexmj league --controller examples/train_ppo.py:RIGHTING ldvs`.
"""

import json
import time
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hexmj
from hexmj.environments.learned import TILT, TURNING, WithOffsets

FOUND = Path(__file__).with_name("righting.json")
VELOCITY, DURATION, STARTS = 0.6, 40.0, 200  # V_r, the observation time `start` [time units], starts to compare
STRIDE, HELD = hexmj.Stride(dt=0.2), 50  # time step while learning [time units], and steps that an action lasts
INSECTS, ACTIONS, ROLLOUTS = 128, 2, 32  # actions of each insect between two updates
SPREAD = 0.2  # standard deviation of the gains, constant
FALL, TIPPING = 200.0, 0.25  # costs of a fall and of tipping ahead squared; a step earns at most 1
LEAN = 0.5  # lean at which a gain of 1 gives the largest offset [usual tilt]

LEFT = np.array([1, 1, 1, -1, -1, -1])  # +1 on the left
AHEAD = np.array([1, 0, -1, 1, 0, -1])  # +1 in front


@dataclass(frozen=True)
class Righting:
    """Constant offsets of the tips, and reflexes against leaning and tipping ahead; all from -1 to 1."""

    forward: float = 0.0
    outward: float = 0.0
    up_as_it_leans: float = 0.0
    """Up in front as the body leans ahead; a negative gain presses the front feet down."""
    up_as_it_tips: float = 0.0

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Return the offsets of the tips, (n, leg * axis)."""
        return offsets(np.array([astuple(self)]), felt)


def offsets(gains: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Return offsets, (n, leg * axis), for gains, (n or 1, gain)."""
    forward, outward, leans, tips = np.broadcast_to(gains, (len(felt), 4)).T[..., None]
    leaning, tipping = felt[:, TILT][:, :1] / LEAN, felt[:, TURNING][:, 1:2]
    up = (leans * leaning + tips * tipping) * AHEAD
    return np.clip(np.stack([forward + 0 * up, outward * LEFT, up], axis=-1), -1, 1).reshape(-1, 18)


def reward(walked: np.ndarray, felt: np.ndarray, fell: np.ndarray) -> np.ndarray:
    """Return the environment's reward, less the costs of a fall and of tipping ahead or back."""
    return walked - TIPPING * np.minimum(felt[:, TURNING][:, 1] ** 2, 9.0) - FALL * fell


def held(insects: Any) -> Any:
    """Return an environment whose action, the gains, is held for `HELD` steps and earns the mean of their rewards.

    Its observation is constant. After the end of its episode, an insect earns nothing until the next action.
    """
    from gymnasium.spaces import Box
    from stable_baselines3.common.vec_env import VecEnvWrapper

    class Held(VecEnvWrapper):
        seen = np.ones((insects.num_envs, 1), np.float32)

        def reset(self) -> np.ndarray:
            self.felt: Any = self.venv.reset()
            return self.seen

        def step_async(self, actions: np.ndarray) -> None:
            self.gains = actions.astype(float)

        def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
            earned, done = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
            infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
            for _ in range(HELD):
                self.felt, walked, ends, ended = self.venv.step(offsets(self.gains, self.felt))
                last, fell = np.array(self.felt), ends.copy()
                for i in np.flatnonzero(ends).tolist():
                    last[i], fell[i] = ended[i]["terminal_observation"], not ended[i]["TimeLimit.truncated"]
                    infos[i] = infos[i] or ended[i] | {"terminal_observation": self.seen[i]}
                earned += ~done * reward(walked, last, fell)
                done |= ends
            return self.seen, (earned / HELD).astype(np.float32), done, infos

    return Held(insects, Box(0.0, 1.0, (1,)), Box(-1.0, 1.0, (4,)))


def main() -> None:
    """Learn the gains, write them, and compare them with LDVS."""
    import torch
    from stable_baselines3 import PPO

    from hexmj.environments.stable_baselines import FeltInsects

    torch.set_num_threads(1)  # more threads add in another order and find other gains
    began, cpu = time.monotonic(), time.process_time()
    insects = FeltInsects(INSECTS, velocity=VELOCITY, duration=DURATION, stride=STRIDE)
    size, net = INSECTS * ACTIONS, {"net_arch": [], "log_std_init": float(np.log(SPREAD))}
    agent = PPO(
        "MlpPolicy", held(insects), policy_kwargs=net, n_steps=ACTIONS,
        batch_size=size, n_epochs=10, gamma=0.9, gae_lambda=0.9, learning_rate=1e-2, seed=1, device="cpu",
    )  # fmt: skip
    agent.policy.log_std.requires_grad = False
    agent.learn(ROLLOUTS * size)
    gains = agent.predict(np.ones(1, np.float32), deterministic=True)[0].astype(float).round(3)
    result = {"made by": "python examples/train_ppo.py", "gains": asdict(Righting(*gains.tolist()))}
    FOUND.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    spent = f"{time.monotonic() - began:.0f} s, {time.process_time() - cpu:.0f} s of processor time"
    print(f"{FOUND} after {agent.num_timesteps} actions in {spent}")
    both = {"ldvs": hexmj.LDVS, "righting": found()}
    result = hexmj.compare(both, [VELOCITY], n_starts=STARTS, observation_time="start", seed=77)
    ends = (result[name].values[:, 0] for name in ("physical", "physical_low", "physical_high"))
    for name, falls, low, high in zip(both, *ends, strict=True):
        print(f"{name}: {falls:.2f} ({low:.2f} to {high:.2f}) fall at V = {VELOCITY:g}, of {STARTS} fresh starts")


def found() -> WithOffsets:
    """Return LDVS with the gains from the file."""
    return WithOffsets(Righting(**json.loads(FOUND.read_text(encoding="utf-8"))["gains"]), name="righting")


if FOUND.exists():
    RIGHTING = found()

if __name__ == "__main__":
    main()
