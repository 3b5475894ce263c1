"""Deprecated name, until all areas have moved."""

from hexmj.controllers.baselines import *  # noqa: F403
