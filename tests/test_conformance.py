"""Interface checks: controllers that keep the interface pass, and every broken law is found."""

import json
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest

import hexmj
from broken_controllers import BROKEN, steps_changed
from coarse_steps import COARSE
from hexmj.controllers import conformance
from hexmj.controllers.baselines.metronomes import Metronome
from hexmj.controllers.conformance import check_controller, findings
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.controllers.laws import FIRST, LAWS
from hexmj.errors import InputError
from stepwise_ldvs import Own
from tiers import few_of
from waiting_legs import OWN

LDVS = hexmj.LDVS


@pytest.mark.slow
@pytest.mark.parametrize("order", few_of(["printed", "undelayed", "sequential"], "printed"))
@pytest.mark.parametrize("name", ["ldvs", "uncoordinated", "own-0.1", "own"])
def test_the_network_conforms(name, order):
    controller = replace(hexmj.PRESETS[name], order=order)
    check_controller(controller)
    assert controller.mirrored == (order != "sequential" and name != "own-0.1")


@pytest.mark.slow
def test_other_controllers_conform():
    check_controller(hexmj.SensoryFeedback(LDVS))
    check_controller(replace(LDVS, name="fine"), hexmj.Stride(dt=0.05, geometry=hexmj.CENTRED))
    assert all(finding.well and finding.found for finding in findings(Own()))
    check_controller(Metronome("wilson"), hexmj.Stride(dt=1.0))


def test_a_controller_that_refuses_some_walks_is_checked_in_the_others():
    stride = hexmj.Stride(dt=0.2)
    with pytest.raises(AssertionError, match="begin"):
        check_controller(COARSE, stride)
    for velocities in ([0.3, 0.4], [0.0, 0.1]):
        check_controller(COARSE, stride, velocities)
    for velocities in ([], [1.0], [0.4], [n / 40 for n in range(17)], [0.5, 0.9999]):
        with pytest.raises(InputError):
            check_controller(COARSE, stride, velocities)


@pytest.mark.parametrize("velocities", [(0.2, 0.4), (0.1, 0.05), (0.02, 0.0), (0.05, 0.5)])
def test_who_does_not_accelerate_is_found_at_any_velocities(velocities):
    """And is asked to begin at none that is below the least."""

    @dataclass(frozen=True)
    class Constant(Cruse1998):
        def begin(self, starts, velocity, stride, acceleration=None, threads=None):
            assert acceleration is None or acceleration.start >= min(velocities)
            return super().begin(starts, velocity, stride, None, threads)

    wrong = {one.name for one in findings(Constant(LDVS.weights), velocities=velocities) if not one.well}
    assert "times" in wrong


@pytest.mark.parametrize(("law", "controller"), BROKEN)
def test_a_broken_law_is_found(law, controller):
    trials = conformance._trials(controller, np.array(conformance.VELOCITIES), hexmj.Stride())
    assert any(conformance._failure(LAWS[law], trial) for trial in trials)


@pytest.mark.parametrize("law", FIRST)
def test_one_cause_is_found_once(law):
    """The checks after one of `FIRST` would find the same again."""
    for broken, controller in BROKEN:
        if broken == law:
            *kept, finding = findings(controller)
            assert finding.name == law and not finding.well
            assert all(earlier.well for earlier in kept if earlier.name != "settings")


def test_sliding_feet_are_a_remark():
    walks = Own(), steps_changed(x=lambda walk: np.zeros(6), stance=lambda walk: True)
    (*_, still), (*_, slides) = (findings(controller) for controller in walks)
    assert slides.note and not still.note and still.well and slides.well
    assert still.found != slides.found


def test_only_controllers_are_checked():
    for thing in (3, Own, hexmj.Symmetric()):
        with pytest.raises(hexmj.InputError, match="controller"):
            check_controller(cast(Any, thing))


def test_check_controller_says_what_is_wrong(run, tmp_path):
    code, out, _ = run("check-controller", "ldvs")
    assert code == 0
    assert all(line.startswith("ok ") for line in out.splitlines())
    wrong = OWN.replace("return Step(x, stands)", "return Step(x * np.nan, stands)")
    (tmp_path / "mine.py").write_text(wrong)
    code, out, _ = run("check-controller", f"{tmp_path / 'mine.py'}:Waits", "--json")
    assert code == 1
    answer = json.loads(out)
    assert not answer["well"]
    assert [one["found"] for one in answer["checks"] if not one["well"]]
