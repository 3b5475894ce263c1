"""Deprecated name of `planning`, until all areas have moved."""

from contextlib import nullcontext
from typing import Any

from hexmj.controllers.planning import *  # noqa: F403


def said(what: str) -> Any:
    return nullcontext()


def tell(plan: Any, sensed: Any) -> None:
    plan.sense(sensed)
