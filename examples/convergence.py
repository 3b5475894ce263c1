"""As V_p goes to zero the insect tends to its plan: the same starts, with legs of their own mass and of almost none."""

from pathlib import Path

import hexmj
from hexmj.studies.static_limit import StaticLimit
from hexmj.sweep import run_study

folder = Path("results/converge/walks")  # keeps finished walks, where `hexmj converge` keeps them
study = StaticLimit(hexmj.LDVS, velocity=0.5, vps=(400.0, 100.0, 25.0), n_starts=12, observation_time="start")
result = run_study(study, folder)
print("legs' mass  V_p [mm/s]  kinematic  physical  agreement  margins apart [mm]  centre of mass from O [mm]")
for mass in result.leg_mass.values:
    for vp in result.vp.values:
        one = result.sel(leg_mass=mass, vp=vp)
        print(
            f"{mass:10g} {vp:11g} {one.kinematic.item():10.2f} {one.physical.item():9.2f} {one.agreement.item():10.2f}"
            f" {one.margin.mean().item():19.2f} {one.drift.mean().item():27.3f}"
        )
