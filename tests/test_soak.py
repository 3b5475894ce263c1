"""A seeded sample of what `make soak` tries a hundred thousand times: no traceback, no hang, nothing half written."""

from collections import Counter

import pytest

from tests.soak.drawn import KINDS, try_inputs
from tests.soak.walks import tried

pytestmark = pytest.mark.slow

INPUTS = 30


@pytest.mark.parametrize("kind", KINDS)
def test_no_input_is_answered_by_a_traceback(kind):
    tried = try_inputs(kind, INPUTS, 1998)
    assert not tried.faults
    assert sum(tried.codes.values()) == INPUTS
    assert INPUTS // 4 < tried.codes[1] + tried.codes[2] < INPUTS


def test_every_start_is_stable_fallen_or_refused_with_a_reason():
    accounts = [tried(seed, 4) for seed in range(12)]
    counts = sum((one.counts for one in accounts), Counter[str]())
    assert not any(one.odd for one in accounts)
    assert counts["stable"] + counts["fallen"] + counts["refused"] == counts["drawn"] == 48
    assert min(counts["stable"], counts["fallen"], counts["refused"]) > 0
    assert sum(sum(one.reasons.values()) for one in accounts) == counts["refused"]
