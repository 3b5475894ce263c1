"""Kinematic stability against falls: the same 16 starts at two swing velocities."""

import hexmj

for vp in (20.0, 400.0):
    result = hexmj.compare(hexmj.LDVS, velocities=[0.5], n_starts=16, conditions=hexmj.Conditions(vp=vp))
    cell = result.isel(controller=0, velocity=0)
    print(
        f"V_p = {vp:g} mm/s: kinematic FLSS {cell.kinematic.item():.2f}, measured {cell.measured.item():.2f},"
        f" physical {cell.physical.item():.2f}, agreement {cell.agreement.item():.2f}"
    )
