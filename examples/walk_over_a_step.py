"""Walk over a step without sensory feedback, and film the walk from the side."""

from pathlib import Path

import numpy as np

import hexmj

HEIGHT = 3.0  # mm
starts = hexmj.draw_starts(4, seed=0)
conditions = hexmj.Conditions(ground="step", ground_height=HEIGHT, ground_at=60.0)
walked = hexmj.physical_walk(starts, hexmj.LDVS, velocity=0.4, duration=300.0, conditions=conditions)

fell = np.isfinite(walked.outcomes.fall)
climbed = walked.qpos[-1, :, 2] - walked.qpos[0, :, 2]  # of the body [mm]; NaN after a fall
for i in range(len(starts)):
    print(f"start {i}: {'fell' if fell[i] else f'climbed {climbed[i]:.1f} of {HEIGHT:g} mm'}")

out = Path("results/examples")
out.mkdir(parents=True, exist_ok=True)
recording = hexmj.record(walked, int(np.argmin(fell)), title=f"LDVS, a step of {HEIGHT:g} mm")
frames = hexmj.render([recording], out / "step.mp4", hexmj.Film(camera="side", slow_motion=1.0))
print(f"{frames} frames in {out / 'step.mp4'}")
