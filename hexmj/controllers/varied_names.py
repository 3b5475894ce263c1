"""How controllers are called of which a mechanism or rule is left out, or switched on: `ldvs-without-3`.

A module of its own, for which nothing is compiled: commands ask for it where numba may keep nothing, to say so.
"""

import re

VARIED = re.compile(r"(?P<name>.+)-(?P<how>without|with)-(?P<which>\d)")
"""Such a name as a whole."""

PART = re.compile(r"(-(without|with)-\d)+$")
"""The ends of such names."""
