"""Names and units of what is measured of strides."""

SEGMENTS = ("front", "middle", "hind")
"""Pairs of legs from front to rear."""

JOINTS = ("thorax-coxa", "coxa-trochanter", "femur-tibia")
"""Of a leg with three, from the body outwards."""

WHOLE = {
    "speed": "mm/s",
    "ripple: least over mean speed": "1",
    "period": "s",
    "duty factor": "1",
    "way of a standing foot": "mm",
    "phase, ipsilateral": "1",
    "phase, contralateral": "1",
    "vertical peaks: greatest over least": "1",
    "work of standing legs at the coxa-trochanter": "%",
    **{f"{joint} torque against its movement": "% of stance" for joint in JOINTS},
    "pitch of the thorax": "deg",
    "pitch, range over the strides": "deg",
    "height of the centre of mass, range over the strides": "mm",
    "cost of transport, positive work": "1",
    "cost of transport, all work": "1",
    "positive work of the joints": "J/kg/m",
    "work on the centre of mass": "J/kg/m",
}
"""Quantities of the whole body, and their units."""

PHASES = "phase, ipsilateral", "phase, contralateral"
"""Quantities on the circle [0, 1)."""

EACH = {
    "vertical impulse": "% W",
    "fore-aft impulse": "% W",
    "inward impulse": "% W",
    "vertical peak of a leg": "W",
    **{f"{joint} torque": "mN mm" for joint in JOINTS},
    "coxa-trochanter torque past half its peak, from": "% of stance",
    "coxa-trochanter torque past half its peak, until": "% of stance",
    "height of the coxae": "mm",
}
"""Quantities of each pair of legs, and their units; impulses are of both legs together."""

UNITS = WHOLE | {f"{name}, {segment}": unit for name, unit in EACH.items() for segment in SEGMENTS}
"""All quantities, and their units."""
