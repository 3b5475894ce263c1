"""Mark of tests that draw: they are skipped if nothing can be rendered, except in CI."""

import os

import pytest

from hexmj.rendering import gl

drawing = pytest.mark.skipif(
    not os.environ.get("CI") and gl.missing() is not None,
    reason="nothing can be rendered here: `make system` installs what it takes, as root",
)
