"""Deprecated name of `wrappers`, until all areas have moved."""

from hexmj.controllers.wrappers import *  # noqa: F403
