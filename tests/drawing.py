"""Tests that draw: left out where nothing can be rendered, but by CI, which has to be able to."""

import os

import pytest

from hexmj.rendering import gl

drawing = pytest.mark.skipif(
    not os.environ.get("CI") and gl.missing() is not None,
    reason="nothing can be rendered here: `make system` installs what it takes, as root",
)
