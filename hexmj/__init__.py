"""hexmj: controllers of six-legged walking drive a stick insect; its stability is measured with and without physics.

Units are mm, g, s and radians. A velocity V is a fraction of the protraction velocity V_p. One time unit of a plan is
1 mm / V_p. A name such as `hexmj.flss` is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
