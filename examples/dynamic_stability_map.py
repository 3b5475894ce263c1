"""Which walks that lose static stability stay up in physics, and how? A small map over the swing velocity V_p."""

from pathlib import Path

import hexmj
from hexmj.studies.stability_map import StabilityMap
from hexmj.sweep import run_study

folder = Path("results/map/walks")  # cached results, shared with `hexmj map`
study = StabilityMap(hexmj.LDVS, "vp", values=[20.0, 320.0], velocities=[0.5], n_starts=20)
result = run_study(study, folder)
for vp in result.value.values:
    cell = result.sel(value=vp, velocity=0.5)
    print(f"V_p = {vp:g} mm/s, Froude number {cell.froude.item():.2g}:", end=" ")
    print(f"kinematic FLSS {cell.kinematic.item():.2f}, physical {cell.physical.item():.2f}")
    for name, count in zip(cell.mechanism_name.values, cell["count"].values, strict=True):
        if count:
            print(f"    {count:2d} {name.replace('_', ' ')}")
