"""The insect as a dm_env environment: the controller walks one episode, and every action is zero."""

import numpy as np

from hexmj.environments import dm


def main() -> None:
    """Walk one episode and print its rewards."""
    walking = dm.load(velocity=0.3, actions="tips")
    spec = walking.action_spec()
    step = walking.reset()
    rewards, speeds = [], []
    while not step.last():
        step = walking.step(np.zeros(spec.shape))
        rewards.append(step.reward)
        speeds.append(step.observation["velocity"][0])
    end = "fell" if step.discount == 0 else "still walked"
    print(f"The insect {end} after {walking.physics.time():.2f} s, {len(rewards)} steps.")
    print(f"return {sum(rewards):.0f}, {np.mean(rewards):.2f} a step")
    print(f"speed {np.mean(speeds):.1f} mm/s, commanded {step.observation['command'].item():.1f} mm/s")


if __name__ == "__main__":
    main()
