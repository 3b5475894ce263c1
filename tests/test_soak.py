"""A seeded sample of what `make soak` tries a hundred thousand times: no traceback, no hang, nothing half written."""

import pytest

from tests.soak.drawn import KINDS, try_inputs

INPUTS = 60


@pytest.mark.parametrize("kind", KINDS)
def test_no_input_is_answered_by_a_traceback(kind):
    tried = try_inputs(kind, INPUTS, 1998)
    assert not tried.faults
    assert sum(tried.codes.values()) == INPUTS
    assert INPUTS // 4 < tried.codes[1] + tried.codes[2] < INPUTS
