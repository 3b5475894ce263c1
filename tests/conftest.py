"""hexmj chooses how MuJoCo renders, which must happen before any test imports MuJoCo."""

import hexmj

__all__ = ["hexmj"]
