"""Deprecated name of `registry`, until all areas have moved."""

from hexmj.controllers.registry import *  # noqa: F403
