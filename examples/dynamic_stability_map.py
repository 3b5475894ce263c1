"""When do dynamics save a walk that is lost on paper, and how?  A small map over the swing velocity V_p."""

from pathlib import Path

import hexmj
from hexmj.studies.stability_map import StabilityMap
from hexmj.sweep import run_study

folder = Path("results/map/walks")  # keeps finished walks, where `hexmj map` keeps them
study = StabilityMap(hexmj.LDVS, "vp", values=[20.0, 320.0], velocities=[0.5], n_starts=20)
result = run_study(study, folder)
for vp in result.value.values:
    one = result.sel(value=vp, velocity=0.5)
    print(f"V_p = {vp:g} mm/s, Froude number {one.froude.item():.2g}:", end=" ")
    print(f"kinematic FLSS {one.kinematic.item():.2f}, physical {one.physical.item():.2f}")
    for name, count in zip(one.mechanism_name.values, one["count"].values, strict=True):
        if count:
            print(f"    {count:2d} {name.replace('_', ' ')}")
