"""What a body can be told to do: the network as it goes on, or a plan that exists already."""

from typing import Protocol, runtime_checkable

import numpy as np

from hexmj.parameters import Network
from hexmj.walks import Walk


class Plan(Protocol):
    """A walk of many starts, planned as far as asked for; `network.NetworkRun` is one."""

    network: Network
    """Its constants."""
    done: int
    """Steps planned so far."""

    def advance(self, steps: int) -> Walk:
        """The next `steps` steps."""
        ...


@runtime_checkable
class SeeingPlan(Plan, Protocol):
    """A plan that can go on from other legs than its own."""

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Go on from these tips [mm] and states, both (start, leg)."""
        ...
