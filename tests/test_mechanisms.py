"""Mechanisms of falls and rescues: they share out all starts, know no left and right, and their names are true."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj import LDVS, Conditions, Geometry, Stride, draw_starts, first_loss, loss_time, physical_walk, walk
from hexmj.legs import FIG1, MIRROR
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.outcomes import Outcomes
from hexmj.rotations import lean
from hexmj.studies.mechanisms import MECHANISMS, SAVED, fall_direction, mechanisms, static_plan
from hexmj.walks import AnyWalk, PlannedWalk, Walk

NAMES = np.array(list(MECHANISMS))
RIGHT_AND_FRONT = [0, 3, 4, 5]  # lifted, these leave two feet on the left
STEPS, LOST, LANDED, END = 300, 100, 140, 200  # of 1.25 ms; END is that of a fall


@pytest.fixture(scope="module", params=[80.0, 320.0])
def walked(request):
    return physical_walk(draw_starts(24, 0), LDVS, 0.7, 80.0, conditions=Conditions(vp=request.param))


def staged(*, fall: bool = False, lean: dict[int, tuple[float, float]] | None = None, **stands: slice) -> PhysicalWalk:
    """A walk of one start on a stage: four legs are in the air from `LOST` to `LANDED`.

    Args:
        fall: at `END`.
        lean: step -> how far the trunk leans ahead and to the left from there on [rad].
        stands: when each of the legs in the air is measured to stand all the same.
    """
    steps = END if fall else STEPS
    planned = np.ones((STEPS, 1, 6), dtype=bool)
    planned[LOST:LANDED, 0, RIGHT_AND_FRONT] = False
    measured = planned.copy()
    for leg, when in stands.items():
        measured[when, 0, int(leg[3:])] = True
    measured[steps:] = False
    qpos = np.zeros((STEPS, 1, 25))
    qpos[..., 3] = 1.0
    for step, (ahead, left) in (lean or {}).items():
        angle = np.hypot(ahead, left)
        axis = np.array([-left, ahead]) / max(angle, 1e-9)  # the trunk turns about it
        qpos[step:, 0, 3], qpos[step:, 0, 4:6] = np.cos(angle / 2), np.sin(angle / 2) * axis
    qpos[steps:] = np.nan
    time, x = np.arange(1, STEPS + 1) * 0.1, np.zeros((STEPS, 1, 6))
    y, v = np.broadcast_to(FIG1.y, x.shape), np.full((STEPS, 1), 0.5)
    seen = np.where(np.isnan(qpos[..., :1]), np.nan, x)
    outcomes = Outcomes(**{name: np.full(1, np.inf) for name in Outcomes.__dataclass_fields__})
    outcomes = replace(outcomes, fall=np.array([END * 0.1 if fall else np.inf]))
    aep, height = np.full(x.shape, Stride.aep0), np.full(x.shape, np.nan)
    plan = PlannedWalk(time, v, x, y, planned, aep=aep, height=height)
    return PhysicalWalk(
        planned=plan,
        ordered=plan,
        measured=Walk(time, v, seen, y, measured),
        outcomes=outcomes,
        qpos=qpos,
        centre_of_mass=np.zeros((STEPS, 1, 3)),
        height=np.zeros(x.shape),
        load=np.ones(x.shape),
        conditions=Conditions(),
        stride=Stride(),
    )


def mirrored(walk: PhysicalWalk) -> PhysicalWalk:
    """The same walk in a mirror: left and right legs change places, rolling and turning their sign."""
    legs = list(MIRROR)

    def reflect(one: AnyWalk) -> AnyWalk:
        return replace(one, x=one.x[..., legs], y=-one.y[..., legs], stance=one.stance[..., legs])

    qpos = walk.qpos.copy()
    qpos[..., [1, 4, 6]] *= -1.0
    return replace(walk, planned=reflect(walk.planned), measured=reflect(walk.measured), qpos=qpos)


def test_every_start_has_the_mechanism_that_its_outcomes_allow(walked):
    names = NAMES[mechanisms(walked)]
    fell, lost = np.isfinite(walked.outcomes.fall), np.isfinite(walked.outcomes.planned_loss)
    assert fell.any()
    assert (lost & ~fell).any()
    assert np.array_equal(np.isin(names, SAVED), lost & ~fell)
    assert np.array_equal(names == "never_lost", ~lost & ~fell)
    assert np.array_equal(np.isfinite(fall_direction(walked)), fell)
    assert lost[np.isin(names, ["tipped_behind", "tipped_ahead"])].all()
    assert not fell[np.isin(names, ["never_lost", *SAVED])].any()


def test_in_a_mirror_the_mechanisms_are_the_same_and_falls_go_to_the_other_side(walked):
    assert np.array_equal(mechanisms(mirrored(walked)), mechanisms(walked))
    assert_allclose(fall_direction(mirrored(walked)), -fall_direction(walked))


STAGED = {
    "never_lost": {},
    "still_standing": {},
    "too_short": {"lean": {110: (0.0, -0.04), 150: (0.0, 0.0)}},
    "landed_in_time": {"lean": {110: (0.0, -0.08), 150: (0.0, 0.0)}},
    "caught": {"lean": {110: (0.1, -0.2), 150: (0.0, 0.0)}, "leg4": slice(120, 140)},
    "tipped_behind": {"lean": {120: (-0.1, -0.1)}, "fall": True},
    "tipped_ahead": {"lean": {120: (0.1, -0.1)}, "fall": True},
    "thrown": {"lean": {110: (0.1, -0.2), 150: (-0.2, 0.1)}, "leg4": slice(120, 140), "fall": True},
    "unplanned": {"lean": {190: (-0.2, 0.1)}, "fall": True},
    "narrow": {"lean": {190: (-0.2, 0.1)}, "fall": True},
}


@pytest.mark.parametrize("name", STAGED)
def test_names_are_true_on_a_stage(name):
    walk = staged(**STAGED[name])
    if name in ("never_lost", "still_standing"):  # all feet stay down, by plan or by delay
        walk.measured.stance[:] = True
    if name == "never_lost":
        walk.planned.stance[:] = True
    if name == "narrow":
        walk.planned.x[180:] = 19.5  # the hind feet half a millimetre behind O
    assert set(STAGED) == set(MECHANISMS)
    assert NAMES[mechanisms(walk)[0]] == name


SEEN = {  # V and V_p -> start -> its name, and how the trunk leans one after the other, ahead and to the left [degrees]
    (0.5, 80.0): {
        0: ("never_lost", [(0.2, 1.3)]),
        52: ("still_standing", [(-1.7, 1.7)]),  # eight steps are lost on paper, 17 mm within the feet that stand
        38: ("too_short", [(0.5, -3.7)]),
        30: ("landed_in_time", [(3.2, -2.9)]),  # the right front foot is six steps from its AEP
        1: ("tipped_behind", [(-2.1, 2.1), (-7.2, 6.4)]),
        6: ("thrown", [(2.5, -1.5), (7.3, -2.1), (-9.2, 3.0)]),  # that foot lands under a trunk that leans on it
        85: ("thrown", [(8.4, 5.6), (-8.9, -6.1)]),  # the left one
    },
    (0.5, 20.0): {
        28: ("caught", [(15.1, 13.3)]),  # by the left front foot, 125 steps from its AEP
        60: ("narrow", [(-2.1, -2.0), (-7.0, -8.4)]),  # the plan keeps 0.46 mm
        94: ("thrown", [(3.0, -0.3), (-7.4, 4.6)]),  # without a planned loss: a standing foot hovers
    },
    (0.7, 80.0): {13: ("tipped_ahead", [(2.7, 1.2), (15.2, 7.0)])},  # onto its head
}


@pytest.mark.parametrize("how", SEEN)
def test_names_are_true_of_walks_that_were_looked_at(how):
    """Step by step: leans, feet, loads and margins; `unplanned` is the only name that no walk was found for."""
    (velocity, vp), starts = how, draw_starts(100, 0)[list(SEEN[how])]
    walk = physical_walk(starts, LDVS, velocity, 60.0, conditions=Conditions(vp=vp))
    leans = np.degrees(lean(walk.qpos[..., 3:7])[0])
    names = NAMES[mechanisms(walk)]
    for i, (name, passed) in enumerate(SEEN[how].values()):
        assert names[i] == name
        step = 0
        for wanted in passed:
            near = np.linalg.norm(leans[step:, i] - wanted, axis=1) < 0.6
            assert near.any(), (name, wanted)
            step += int(np.argmax(near))


def test_a_fall_within_the_first_step_has_a_mechanism():
    walk = staged(fall=True)
    walk.qpos[:], walk.measured.x[:], walk.measured.stance[:] = np.nan, np.nan, False
    (found,) = mechanisms(replace(walk, outcomes=replace(walk.outcomes, fall=np.array([0.05]))))
    assert [*MECHANISMS][found] not in {"never_lost", *SAVED}


def test_a_leg_that_catches_and_then_lets_the_trunk_on_is_not_said_to_throw_it():
    lean = {110: (-0.1, -0.1), 150: (-0.15, -0.15)}
    walk = staged(lean=lean, leg4=slice(120, 140), fall=True)
    assert NAMES[mechanisms(walk)[0]] == "tipped_behind"
    assert_allclose(fall_direction(walk), np.radians(-135.0))


def test_of_several_losses_the_hardest_names_the_start():
    walk = staged(lean={110: (0.0, -0.08), 150: (0.0, 0.0)})
    walk.planned.stance[220:230, 0, RIGHT_AND_FRONT] = False  # the feet stay down
    assert NAMES[mechanisms(walk)[0]] == "landed_in_time"


def test_the_static_criterion_sees_the_body_from_its_own_centre_of_mass():
    """To move the centre of mass ahead is to move all legs behind."""
    starts, behind = draw_starts(40, 1), -6.0
    front, middle, hind = FIG1.origins
    moved = Stride(geometry=Geometry(origins=(front - behind, middle - behind, hind - behind)))
    seen = replace(staged(), planned=walk(starts, LDVS, 0.5, 60.0), conditions=Conditions(centre_of_mass=behind))
    losses = loss_time(static_plan(seen))
    assert np.array_equal(losses, first_loss(starts, LDVS, 0.5, 60.0, stride=moved))
    assert np.isfinite(losses).any()
