"""As V_p goes to zero, the insect follows its plan: the same starts, with normal and nearly massless legs."""

from pathlib import Path

import hexmj
from hexmj.studies.static_limit import StaticLimit
from hexmj.sweep import run_study

folder = Path("results/converge/walks")  # cached results, shared with `hexmj converge`
study = StaticLimit(hexmj.LDVS, velocity=0.5, vps=(400.0, 100.0, 25.0), n_starts=12, observation_time="start")
result = run_study(study, folder)
print("leg mass    V_p [mm/s]  kinematic  physical  agreement  margins apart [mm]  centre of mass from O [mm]")
for mass in result.leg_mass.values:
    for vp in result.vp.values:
        cell = result.sel(leg_mass=mass, vp=vp)
        print(
            f"{mass:10g} {vp:11g} {cell.kinematic.item():10.2f} {cell.physical.item():9.2f}"
            f" {cell.agreement.item():10.2f} {cell.margin.mean().item():19.2f} {cell.drift.mean().item():27.3f}"
        )
