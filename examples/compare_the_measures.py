"""Static stability on paper against real falls: the same 16 starts at two swing velocities."""

import hexmj

for vp in (20.0, 400.0):
    result = hexmj.compare(hexmj.LDVS, velocities=[0.5], n_starts=16, conditions=hexmj.Conditions(vp=vp))
    one = result.isel(controller=0, velocity=0)
    print(
        f"V_p = {vp:g} mm/s: kinematic FLSS {one.kinematic.item():.2f}, measured {one.measured.item():.2f},"
        f" physical {one.physical.item():.2f}, agreement {one.agreement.item():.2f}"
    )
