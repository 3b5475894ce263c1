"""The check of controllers: those that keep the protocol pass, and what breaks a law is found in one sentence."""

import json
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import hexmj
from broken_controllers import BROKEN, BegunOtherwise, Melting, steps_changed
from coarse_steps import COARSE
from hexmj.controllers import conformance
from hexmj.controllers.conformance import FIRST, check_controller, findings
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.controllers.baselines.metronomes import Metronome
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


@pytest.mark.thorough
def test_other_controllers_conform():
    check_controller(hexmj.SensoryFeedback(LDVS))
    check_controller(replace(LDVS, name="fine"), hexmj.Stride(dt=0.05, geometry=hexmj.CENTRED))
    assert all(finding.well and finding.found for finding in findings(Own()))
    check_controller(BegunOtherwise())
    check_controller(Metronome("wilson"), hexmj.Stride(dt=1.0))


def test_who_refuses_some_walks_is_held_to_the_laws_in_the_others():
    stride = hexmj.Stride(dt=0.2)
    with pytest.raises(AssertionError, match=r"begin: .*; if it cannot plan there, ask for other"):
        check_controller(COARSE, stride)
    for velocities in ([0.3, 0.4], [0.05, 0.02], [0.0, 0.1]):
        check_controller(COARSE, stride, velocities)
    many = [n / 40 for n in range(17)]
    for velocities, said in (
        ([], "a list"),
        ([1.0], "V < 1"),
        ([0.4], "2 to 16"),
        (many, "2 to 16"),
        ([0.5, 0.9999], "V and a step"),
    ):
        with pytest.raises(InputError, match=said):
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


@pytest.mark.parametrize(("law", "controller", "words"), BROKEN)
def test_what_breaks_a_law_is_found_in_one_sentence(law, controller, words):
    trials = conformance._trials(controller, np.array(conformance.VELOCITIES), hexmj.Stride())
    found = next(filter(None, (conformance._wrong(conformance.LAWS[law][0], trial) for trial in trials)))
    assert re.search(words, found), found
    assert "\n" not in found


@pytest.mark.parametrize("law", FIRST)
def test_one_cause_is_found_once(law):
    """What the laws after one rest on; they would say the same again."""
    for broken, controller, _ in BROKEN:
        if broken == law:
            *kept, finding = findings(controller)
            assert finding.name == law
            assert finding.found.endswith("; the laws after this one were not tried")
            assert all(one.well for one in kept if one.name != "settings")


@pytest.mark.thorough
def test_feet_that_slide_are_told():
    """No law forbids it; tips that stand still slide with V_r, at most."""
    *_, last = findings(Own())
    assert (last.name, last.found) == (
        "sliding",
        "feet that stand stay where they are on the ground: their tips recede at V_r",
    )
    *_, last = findings(steps_changed(x=lambda walk: np.zeros(6), stance=lambda walk: True))
    assert last.well
    assert last.found.startswith("feet that stand would slide: ")
    assert "but one is off by 0.95 V_p, in step 1, start 3 (V = 0.95), leg L1" in last.found
    *_, last = findings(steps_changed(y=lambda walk: walk.y[0] + 1e-3 * walk.time[0]))
    assert "but one is off by 0.001 V_p" in last.found


def test_the_first_law_that_is_broken_is_raised():
    with pytest.raises(AssertionError, match=r"^settings: the dataclass is not frozen; expected"):
        check_controller(Melting())


def test_what_is_no_controller_is_refused():
    for thing in (3, Own, hexmj.Symmetric()):
        with pytest.raises(hexmj.InputError, match="expected a controller, a frozen dataclass"):
            check_controller(thing)
    with pytest.raises(hexmj.InputError, match="a controller's name = 3; expected a text"):
        check_controller(Own(name=3))  # pyright: ignore[reportArgumentType]


def test_check_controller_says_what_is_wrong(run, tmp_path):
    code, out, _ = run("check-controller", "ldvs")
    assert code == 0
    *laws, last = out.splitlines()
    assert all(line.startswith("well   ") for line in laws)
    assert last.startswith("note   sliding: ")
    wrong = OWN.replace("return Step(x, stands)", "return Step(x * np.nan, stands)")
    (tmp_path / "mine.py").write_text(wrong)
    code, out, _ = run("check-controller", f"{tmp_path / 'mine.py'}:Waits", "--json")
    assert code == 1
    answer = json.loads(out)
    assert not answer["well"]
    assert [one["found"] for one in answer["checks"] if not one["well"]]
