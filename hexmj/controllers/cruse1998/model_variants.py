"""Deprecated name, until all areas have moved."""

from hexmj.controllers.cruse1998 import *  # noqa: F403
