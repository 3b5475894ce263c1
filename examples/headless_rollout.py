"""Walk ten random starts kinematically and in MuJoCo."""

import numpy as np

import hexmj

starts = hexmj.draw_starts(10, seed=0)  # (start, leg), mm
plan = hexmj.walk(starts, hexmj.LDVS, velocity=0.5, duration=100.0)
walked = hexmj.physical_walk(starts, hexmj.LDVS, velocity=0.5, duration=100.0, conditions=hexmj.Conditions(vp=80.0))

lost, fell = hexmj.loss_time(plan), walked.outcomes.fall
margin = np.nanmin(hexmj.walk_margin(walked.measured), axis=0)
print("start  planned loss  fall  least measured margin [mm]   (times in time units of 12.5 ms)")
for i in range(len(starts)):
    print(f"{i:5d}  {lost[i]:12.1f}  {fell[i]:4.1f}  {margin[i]:8.2f}")
