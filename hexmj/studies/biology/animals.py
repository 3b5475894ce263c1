"""What was measured in insects: a row for each quantity, its range, and where it stands.

Ranges are those of the sources named, which say how words were read; NaN stands where no figure could be found.
"""

import math
from dataclasses import dataclass
from typing import Literal

from hexmj.studies.biology.names import JOINTS, SEGMENTS

Verdict = Literal["within", "below", "above", "no figure found", "none measured"]

SOURCES = {
    "motion capture": "one adult female Carausius morosus, public data of Theunissen and Duerr: phases, way of a step,"
    " and swings that last 0.10 to 0.16 of the period and 0.14 to 0.17 s, from which period and duty factor follow;"
    " coxae 'about' 12, 10, 8 mm high, read as 1 mm more or less",
    "Graham 1983": "J. exp. Biol. 104, 129, Introduction: in Carausius the least velocity of a leg's cycle is 'usually"
    " close to zero', read as at most a tenth of the mean",
    "Full et al. 1991": "Full, Blickhan, Ting, J. exp. Biol. 158, 369, Summary: the cockroach Blaberus runs; first legs"
    " brake, third legs drive, second do both, vertical peaks are equal, forces point to the coxae",
    "Dallmann et al. 2016": "Dallmann, Duerr, Schmitz, Proc. R. Soc. B 283, 20151708, abstract: Carausius is driven by"
    " depression torques about the coxa-trochanter joint, read as more than half of the work",
    "Zill et al. 2018": "Zill, Dallmann, Bueschges, Chaudhry, Schmitz, J. Neurophysiol. 120, 1807, abstract: forces in"
    " the course of joint torques of freely walking stick insects; the coxa-trochanter's stands in Szczecinski's code"
    " (nss36/campaniformSensillaModeling, CTrTorqueWaveform.csv), scaled, of no named leg: 0.784 s from zero to zero,"
    " read as a stance, past half its peak from 0.132 to 0.710 s, greatest at 0.432 s",
    "Full et al. 1990": "Full, Zuccarello, Tullis, J. exp. Biol. 150, 233, abstract: 4.6 to 8.5 ml oxygen / g / km of a"
    " beetle, a cricket and a cockroach, at 20.1 J/ml; metabolic, so an upper bound",
    "Full, Tu 1990": "J. exp. Biol. 148, 129, abstract: Blaberus at 80 to 660 mm/s",
    "not read": "measured in walking Carausius by Cruse 1976 and Dallmann et al. 2016, whose figures we have not seen",
    "": "",
}
"""Short name -> source."""

ANY = math.inf
"""Where only the sign is known."""

STEP = 16.0, 20.0  # mm
SWING_SHARE, SWING_REST = (0.10, 0.16), (0.14, 0.17)  # of the period, s
PHASES = {22.0: (0.60, 0.69), 31.0: (0.54, 0.61), 38.0: (0.50, 0.53)}  # at mm/s
COXAE = {"front": 12.0, "middle": 10.0, "hind": 8.0}  # mm, "about"
ABOUT, APART = 1.0, 28.5  # mm: how "about" is read, and front from hind coxae
OXYGEN = 20.1  # J/ml
STANCE = 0.784  # s
PAST, PAST_HALF = "coxa-trochanter torque past half its peak,", {"from": 13.2 / STANCE, "until": 71.0 / STANCE}  # %

SPEED = 24.0
"""Where nothing depends on it in the source [mm/s]; V = 0.3 at V_p = 80 mm/s."""


@dataclass(frozen=True)
class Animal:
    """What is known of a quantity."""

    quantity: str
    """As `quantities` calls it."""
    low: float = math.nan
    high: float = math.nan
    source: str = ""
    """A key of `SOURCES`."""
    speed: float = SPEED
    """At which ours is measured [mm/s]."""
    depends: bool = False
    """The animals' figure holds at this speed alone."""
    built_in: bool = False
    """The body or V_p was chosen by it, so agreement says nothing."""

    def verdict(self, value: float) -> Verdict:
        """Of a value of ours, NaN where it was measured in no start; its interval has no say."""
        if math.isnan(self.low) or math.isnan(value):
            return "no figure found" if math.isnan(self.low) else "none measured"
        return "below" if value < self.low else "above" if value > self.high else "within"


def timing(speed: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Period [s] and duty factor at a speed [mm/s], each least and greatest.

    A step's way takes s / v, and a swing a share of the period and some time more.
    """
    (short, long), (share, most), (rest, slowest) = ([x / speed for x in STEP], SWING_SHARE, SWING_REST)
    period = (short + rest) / (1.0 - share), (long + slowest) / (1.0 - most)
    duty = short * (1.0 - most) / (short + slowest), long * (1.0 - share) / (long + rest)
    return period, duty


def _each(name: str, low: float = math.nan, high: float = math.nan, source: str = "") -> list[Animal]:
    """The same for every segment."""
    return [Animal(f"{name}, {segment}", low, high, source) for segment in SEGMENTS]


_SEEN = "motion capture"
_SLOPES = [math.degrees(math.atan2(COXAE["front"] - COXAE["hind"] + off, APART)) for off in (-2 * ABOUT, 2 * ABOUT)]

ANIMALS = (
    *_each("vertical impulse", source="not read"),
    Animal("fore-aft impulse, front", -ANY, 0.0, "Full et al. 1991"),
    Animal("fore-aft impulse, middle", source="Full et al. 1991"),
    Animal("fore-aft impulse, hind", 0.0, ANY, "Full et al. 1991"),
    *_each("inward impulse", 0.0, ANY, "Full et al. 1991"),
    *_each("vertical peak of a leg", source="not read"),
    Animal("vertical peaks: greatest over least", 1.0, 1.0, "Full et al. 1991"),
    *(row for joint in JOINTS for row in _each(f"{joint} torque", source="not read")),
    *(row for end, at in PAST_HALF.items() for row in _each(f"{PAST} {end}", at, at, "Zill et al. 2018")),
    Animal("work of standing legs at the coxa-trochanter", 50.0, 100.0, "Dallmann et al. 2016"),
    *(Animal(f"{joint} torque against its movement", source="not read") for joint in JOINTS),
    *(Animal("phase, ipsilateral", *seen, _SEEN, speed, depends=True) for speed, seen in PHASES.items()),
    *(Animal("phase, contralateral", 0.56, 0.63, _SEEN, speed, depends=True) for speed in PHASES),
    *(Animal("duty factor", *timing(speed)[1], _SEEN, speed, depends=True) for speed in PHASES),
    *(Animal("period", *timing(speed)[0], _SEEN, speed, depends=True) for speed in PHASES),
    Animal("way of a standing foot", *STEP, _SEEN),
    *(Animal(f"height of the coxae, {one}", h - ABOUT, h + ABOUT, _SEEN, built_in=True) for one, h in COXAE.items()),
    Animal("pitch of the thorax", min(_SLOPES), max(_SLOPES), _SEEN, built_in=True),
    Animal("pitch, range over the strides"),
    Animal("height of the centre of mass, range over the strides"),
    Animal("ripple: least over mean speed", 0.0, 0.1, "Graham 1983"),
    Animal("cost of transport, positive work"),
    Animal("cost of transport, all work"),
    Animal("positive work of the joints", 4.6 * OXYGEN, 8.5 * OXYGEN, "Full et al. 1990"),
    Animal("work on the centre of mass", 0.9, 0.9, "Full, Tu 1990"),
)
"""The rows of the table."""

SPEEDS = tuple(sorted({row.speed for row in ANIMALS}))
"""At which ours are measured [mm/s]."""
