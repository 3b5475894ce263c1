"""What physics and time step cannot hold is refused, and a walk that exploded is an error; a fall stays an outcome."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.planning import begin
from hexmj.errors import InputError, SimulationError, StillThrown
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics.divergence import MOST_ENERGY, explosion
from hexmj.physics.outcomes import Outcomes, OutcomesSoFar
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import Chunk, drive
from hexmj.physics.settle import Settled, settle
from hexmj.starts import draw_starts
from tiers import few_of

LEG, GRAVITY = 31.0, 9810.0


def thrown(up: float) -> Settled:
    """Settled starts, of which start 1 is thrown up [mm/s]."""
    settled = settle(draw_starts(3, 0))
    settled.state[1, settled.compiled.model.nq + 2] = up
    return settled


def walked(settled: Settled) -> list[Chunk]:
    """For 20 time units."""
    return list(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 20.0))


@pytest.mark.parametrize("grasp", [10.5, 70.0, 100.0])
def test_more_grasp_than_the_contacts_can_hold_is_refused(grasp: float):
    """At 20 the insect was thrown off the ground, and counted as stable where it did not come down in time."""
    with pytest.raises(InputError):
        settle(draw_starts(12, 0), Conditions(grasp=grasp))


def test_as_much_grasp_as_the_contacts_can_hold_keeps_the_insect_on_the_ground():
    settled = settle(draw_starts(12, 0), Conditions(grasp=9.5))
    speed = np.concatenate([np.diff(one.qpos[:, :, 2], axis=1).ravel() for one in walked(settled)])
    assert np.abs(speed).max() / settled.compiled.model.opt.timestep < 100.0


def test_a_walk_with_energy_from_nowhere_is_an_error_with_its_state():
    settled = thrown(up=1500.0)
    with pytest.raises(SimulationError) as error:
        walked(settled)
    assert np.isfinite(error.value.state["qpos"]).all()


def test_a_walk_that_explodes_before_its_push_is_an_error():
    settled, push = thrown(up=1500.0), Push(np.array([0.0, 60.0 * 80.0, 0.0]), np.full(3, 15.0))
    plan = begin(LDVS, settled.starts, 0.3, settled.stride)
    with pytest.raises(SimulationError):
        list(drive(settled, plan, 20.0, pushes=[push]))


def test_energy_is_bounded_well_above_a_walk_and_below_an_explosion():
    fastest = np.sqrt(2 * GRAVITY * (MOST_ENERGY * LEG - 10.0))
    walked(thrown(up=0.95 * fastest))
    with pytest.raises(SimulationError):
        walked(thrown(up=1.05 * fastest))


def test_a_walk_that_turns_over_high_up_is_an_error_unless_it_was_pushed():
    settled, still = settle(draw_starts(2, 0)), np.zeros(2)
    qpos = settled.qpos[:, np.newaxis].repeat(3, axis=1)
    qpos[1, :, 3:7] = np.cos(1.0), 0.0, np.sin(1.0), 0.0  # tilted by 2 rad
    qpos[1, :, 2] = 1.4 * LEG
    everything = np.full(2, 3)
    centre = qpos[..., :3]
    assert explosion(qpos, centre, everything, still, settled) is None
    qpos[1, :, 2] = 1.6 * LEG
    found = explosion(qpos, centre, everything, still, settled)
    assert found and found[:2] == (1, 1)
    assert explosion(qpos, centre, everything, np.array([0.0, 80.0]), settled) is None
    assert explosion(qpos, centre, np.array([3, 1]), still, settled) is None, "it has fallen"


def test_a_push_bounds_the_centre_of_mass_and_may_turn_the_root_about_it_faster():
    settled = settle(draw_starts(1, 0))
    everything, impulse, step = np.full(1, 3), np.full(1, 40.0 * 80.0), settled.compiled.model.opt.timestep
    fastest = np.sqrt(2 * GRAVITY * (MOST_ENERGY * LEG - 10.0) + (80.0 + 40.0 * 80.0) ** 2)
    qpos = settled.qpos[:, np.newaxis].repeat(3, axis=1)
    centre = qpos[..., :3].copy()
    way = np.arange(3) * step * fastest
    qpos[0, :, 1], centre[0, :, 1] = 1.2 * way, 0.95 * way
    assert explosion(qpos, centre, everything, impulse, settled) is None
    centre[0, :, 1] = 1.05 * way
    found = explosion(qpos, centre, everything, impulse, settled)
    assert found and "centre of mass" in found[2]
    assert explosion(qpos, centre, everything, np.zeros(1), settled), "not pushed"


def test_an_insect_that_a_push_still_throws_as_the_window_ends_is_no_outcome():
    """Pushed with 3.2 m/s it counted as standing as long as it had not come down."""
    settled = settle(draw_starts(2, 5))
    plan = [begin(LDVS, settled.starts, 0.5, settled.stride) for _ in range(2)]
    hard, none = (Push(np.array([0.0, push]), np.full(2, 10.0)) for push in (3200.0, 0.0))
    with pytest.raises(StillThrown):
        outcomes_of_plan(settled, plan[0], 14.0, np.full(2, np.inf), pushes=[hard])
    assert np.isinf(outcomes_of_plan(settled, plan[1], 14.0, np.full(2, np.inf), pushes=[none]).fall).all()


def outcomes(conditions: Conditions, velocity: float, push: float = 0.0, duration: float = 80.0) -> Outcomes:
    """Of starts pushed at 20 time units, in multiples of m V_p."""
    settled = settle(draw_starts(24, 5), conditions)
    pushed = Push(np.full(24, push * conditions.vp), np.full(24, 20.0))
    plan = begin(LDVS, settled.starts, velocity, settled.stride)
    return outcomes_of_plan(settled, plan, duration, np.full(24, np.inf), pushes=[pushed])


@pytest.mark.slow
@pytest.mark.parametrize("push", few_of([40.0, 80.0], 80.0))
def test_an_insect_tipped_over_by_a_push_fell(push: float):
    found = outcomes(Conditions(), 0.5, push, duration=120.0)
    assert np.isfinite(found.fall).mean() > 0.5
    assert (found.tilt > pi / 2).any()


@pytest.mark.slow
def test_an_insect_that_tumbles_down_fell():
    """Into a gap; some land on their backs."""
    found = outcomes(Conditions(ground="gap", standing_height=12.0, ground_at=45.0), 0.7, duration=150.0)
    assert np.isfinite(found.fall).mean() > 0.9
    assert (found.tilt > pi / 2).any()


def test_a_walk_without_contact_is_no_outcome():
    """Whatever the reason: what cannot be measured is an error."""
    settled = settle(draw_starts(2, 0))
    so_far = OutcomesSoFar(settled, np.full(2, np.inf))
    for chunk in walked(settled):
        sensors = chunk.sensors.copy()
        sensors[1, :, settled.compiled.columns.touch] = 0.0
        so_far.add(replace(chunk, sensors=sensors))
    with pytest.raises(SimulationError):
        so_far.outcomes()
