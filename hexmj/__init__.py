"""hexmj: controllers of six-legged walking drive a stick insect in MuJoCo, and its stability is measured twice.

Units are mm, g, s and radians; velocities V are fractions of the protraction velocity V_p, and one time
unit of a plan is 1 mm / V_p.  Names are imported when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
