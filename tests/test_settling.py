"""Starts come to rest to the same bits in whatever pieces, between which a stop is heard."""

import signal
import time

import numpy as np
import pytest

from hexmj.conditions import Conditions
from hexmj.physics import backend
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts


@pytest.mark.parametrize("heard", [3, 100, 1000])
def test_in_any_pieces_the_bits_are_the_same(monkeypatch: pytest.MonkeyPatch, heard: int) -> None:
    whole = settle(draw_starts(3, 0))
    monkeypatch.setattr(backend, "HEARD", heard)
    pieces = settle(draw_starts(3, 0))
    for name in ("state", "ctrl", "load", "torques"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name), strict=True)


def test_who_waits_for_rest_can_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(backend, "HEARD", 100)
    begun, before = time.process_time(), signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.5)
        with pytest.raises(KeyboardInterrupt):
            settle(draw_starts(200, 0), Conditions(settling_time=10_000.0), threads=1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.process_time() - begun < 10.0, "all of it would take half a minute"
