"""Record the plan and the physical walk of one start, and render both side by side from the recordings."""

from pathlib import Path

import hexmj

starts = hexmj.draw_starts(1, seed=3)
plan = hexmj.walk(starts, hexmj.LDVS, velocity=0.4, duration=60.0)
walked = hexmj.physical_walk(starts, hexmj.LDVS, velocity=0.4, duration=60.0)

out = Path("results/examples")
out.mkdir(parents=True, exist_ok=True)
recording = hexmj.record(walked, title="LDVS, physical")
hexmj.save_recording(recording, out / "recording.nc")
puppet = hexmj.record_plan(plan, walked.conditions, walked.stride, title="LDVS, planned")
frames = hexmj.render([puppet, hexmj.load_recording(out / "recording.nc")], out / "gait.mp4", hexmj.Film())
print(f"{frames} frames in {out / 'gait.mp4'}")
