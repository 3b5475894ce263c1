"""Deprecated name of `planning`, until all areas have moved."""

from hexmj.controllers.planning import *  # noqa: F403
