"""The ground: obstacles are solid and have no effect before they are reached; slopes and soft ground."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexmj import LDVS, PRESETS, STICK_INSECT, Conditions, InputError, Stride, draw_starts, physical_walk
from hexmj.bodies.ground import beyond_the_ground, ground_level
from hexmj.bodies.mjcf import compile_body
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.settle import settle

GROUNDS = {
    "flat": Conditions(),
    "step": Conditions(ground="step", ground_at=45.0),
    "gap": Conditions(ground="gap", ground_at=45.0, ground_length=5.0),
    "hurdle": Conditions(ground="hurdle", ground_at=45.0),
    "stairs": Conditions(ground="stairs", ground_at=45.0, ground_height=2.0, ground_length=15.0),
    "rough": Conditions(ground="rough", ground_at=45.0, ground_height=4.0),
}


@cache
def walked(ground: str) -> PhysicalWalk:
    """A few starts that reach the obstacle when they have walked 7 mm, and cross it."""
    return physical_walk(draw_starts(3, seed=0), LDVS, 0.6, 150.0, conditions=GROUNDS[ground])


@pytest.mark.parametrize("ground", GROUNDS)
def test_the_ground_is_as_high_as_it_says(ground):
    """Rays from above meet the compiled geoms where `ground_level` has the ground."""
    conditions = GROUNDS[ground]
    model = compile_body(conditions).model
    data = mujoco.MjData(model)
    data.qpos[1] = 5000.0  # the insect out of the way
    mujoco.mj_forward(model, data)
    places = np.random.default_rng(1).uniform((30.0, -40.0), (90.0, 40.0), (200, 2))
    hit = np.zeros(1, dtype=np.int32)
    down = [
        mujoco.mj_ray(model, data, np.array([*place, 50.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        for place in places
    ]
    levels = ground_level(conditions, places)
    assert_allclose(50.0 - np.array(down), levels, atol=1e-6)
    assert (levels != 0).any() == (ground != "flat")


@pytest.mark.parametrize("ground", GROUNDS)
def test_the_trunk_on_any_ground_is_a_fall(ground):
    """Laid down with its legs in the air, on the obstacle itself."""
    compiled = compile_body(replace(GROUNDS[ground], ground_length=300.0) if ground == "hurdle" else GROUNDS[ground])
    model = compiled.model
    data = mujoco.MjData(model)
    level = ground_level(compiled.conditions, np.array([150.0, 0.0]))
    data.qpos[:7] = 150.0, 0.0, level + 1.0, 0.0, 1.0, 0.0, 0.0
    mujoco.mj_forward(model, data)
    assert data.sensordata[compiled.columns.trunk].any()
    assert {model.geom(geom).name for geom in data.contact.geom[:, 0]} != ({"ground"} if ground != "flat" else set())


@pytest.mark.parametrize("ground", ["step", "hurdle"])
def test_feet_stand_on_top_as_on_the_plane(ground):
    long = replace(GROUNDS[ground], ground_length=300.0)
    depths, forces = [], []
    for one, ahead, up in ((GROUNDS["flat"], 0.0, 0.0), (long, 150.0, long.ground_height)):
        compiled = compile_body(one)
        model = compiled.model
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[0] += ahead
        data.qpos[2] += up
        mujoco.mj_step(model, data, nstep=500)
        mujoco.mj_forward(model, data)
        depths.append(np.sort(data.contact.dist))
        forces.append(data.sensordata[compiled.columns.touch].copy())
    assert_allclose(depths[1], depths[0], atol=0.001)
    assert_allclose(forces[1], forces[0], rtol=0.01)


@pytest.mark.parametrize("ground", ["step", "stairs", "gap", "hurdle", "rough"])
def test_nothing_is_felt_before_it_is_reached(ground):
    """The same bits as on flat ground; a bank's box rounds other than a plane."""
    flat, ahead = walked("flat").qpos, walked(ground).qpos
    begin = GROUNDS[ground].ground_at - max(Stride().geometry.origin) - Stride().aep0
    far = np.where(np.isfinite(flat), flat, 0.0)[..., 0].max(axis=1) < begin
    assert 50 < far.sum() < len(far)
    if ground == "gap":
        assert_allclose(ahead[far], flat[far], atol=1e-9)
    else:
        assert_array_equal(ahead[far], flat[far])
    assert not np.array_equal(ahead, flat, equal_nan=True)


@pytest.mark.parametrize(("ground", "size"), [("step", {"ground_height": 2.0}), ("gap", {"ground_length": 1.0})])
def test_who_walks_off_the_ground_that_was_laid_has_not_fallen(ground, size):
    body = replace(STICK_INSECT, lengths=replace(STICK_INSECT.lengths, ground_reach=60.0))
    ahead = Conditions(ground=ground, ground_at=46.0, **size)
    with pytest.raises(InputError, match="start 0"):
        physical_walk(draw_starts(1, 3), PRESETS["own-0.3"], 0.3, 700.0, conditions=replace(ahead, body=body))


@pytest.mark.parametrize(
    ("ground", "within", "beyond"),
    [
        ("flat", [(1e4, 1e4)], []),
        ("rough", [(1e4, 1e4)], []),
        (
            "hurdle",
            [(112.0, 171.0), (499.0, 300.0), (2000.0, 300.0), (501.0, 199.0)],
            [(501.0, 201.0), (501.0, -201.0)],
        ),
        ("step", [(499.0, 300.0), (1499.0, 199.0)], [(501.0, 201.0), (1501.0, 0.0)]),
        ("stairs", [(499.0, 300.0), (1499.0, 199.0)], [(501.0, 201.0), (1501.0, 0.0)]),
        ("gap", [(0.0, 199.0), (-999.0, 0.0), (1500.0, 0.0)], [(0.0, 201.0), (-1001.0, 0.0), (1511.0, 0.0)]),
    ],
)
def test_the_ground_ends_where_its_pieces_do(ground, within, beyond):
    ahead = Conditions(ground=ground, ground_at=500.0, ground_length=10.0, ground_height=2.0)
    for places, ends in ((within, False), (beyond, True)):
        for x, y in places:
            assert beyond_the_ground(ahead, np.array([x, y, 0.0])) == ends, (x, y)


@pytest.mark.parametrize(("axis", "pitch", "roll"), [(0, 0.3, 0.0), (0, -0.3, 0.0), (1, 0.0, 0.3)])
def test_a_slope_tilts_gravity_and_moves_the_projected_centre_of_mass(axis, pitch, roll):
    flat, steep = Conditions(), Conditions(pitch=pitch, roll=roll)
    gravity = compile_body(steep).model.opt.gravity
    assert_allclose(np.linalg.norm(gravity), np.linalg.norm(compile_body(flat).model.opt.gravity))
    assert_allclose(gravity[axis] / gravity[2], np.tan(pitch + roll))
    level, tilted = (physical_walk(draw_starts(1, 1), LDVS, 0.0, 1.0, conditions=case) for case in (flat, steep))
    moved = (tilted.measured.feet - level.measured.feet)[-1, 0, :, axis].mean()
    assert_allclose(moved, 10.0 * np.tan(pitch + roll), rtol=0.1)  # the standing height is 10 mm


def test_the_insect_sinks_into_soft_ground():
    heights = [
        settle(draw_starts(2, 1), Conditions(softness=softness)).qpos[:, 2].mean() for softness in (0.0, 5.0, 10.0)
    ]
    assert heights[0] > heights[1] > heights[2]
