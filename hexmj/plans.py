"""What a body can be told to do: the network as it goes on, or a plan that exists already."""

from typing import Protocol

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
