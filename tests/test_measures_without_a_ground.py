"""Measures of an obstacle that the ground has not got are refused wherever conditions are given in Python."""

from collections.abc import Callable
from typing import Any

import pytest
from hexmj.studies.variants.study import Variants

import hexmj
from hexmj import LDVS, Conditions, InputError
from hexmj.environments import dm
from hexmj.environments.task import Task
from hexmj.studies.ablation import Ablation
from hexmj.studies.biology import Biology
from hexmj.studies.entrants import entrants
from hexmj.studies.league import League
from hexmj.view.live import LiveWalk

STARTS = hexmj.draw_starts(1, 0)

TAKES: dict[str, Callable[[Conditions], Any]] = {
    "compare": lambda told: hexmj.compare(LDVS, 0.3, n_starts=1, observation_time=1.0, conditions=told),
    "walk": lambda told: hexmj.physical_walk(STARTS, LDVS, 0.3, 1.0, conditions=told),
    "dm_env": lambda told: dm.load(conditions=told),
    "task": lambda told: Task(conditions=told),
    "biology": lambda told: Biology(LDVS, conditions=told),
    "search": lambda told: hexmj.Problem(hexmj.NetworkForm(), 0.3, 0.3, conditions=told),
    "variants": lambda told: Variants({"ldvs": [LDVS]}, (0.3,), conditions=told),
    "ablation": lambda told: Ablation({"ldvs": {"ldvs": LDVS}}, conditions=told),
    "live": lambda told: LiveWalk(LDVS, 0.3, STARTS[0], told),
    "live again": lambda told: LiveWalk(LDVS, 0.3, STARTS[0]).begin(conditions=told),
}


@pytest.mark.parametrize("name", TAKES)
def test_a_measure_that_no_walk_would_obey_is_a_sentence(name: str):
    with pytest.raises(
        InputError, match=r"^ground_height = 6\.0 with ground = flat; expected it with a ground that has"
    ):
        TAKES[name](Conditions(ground_height=6.0))


def test_the_league_s_trials_have_their_own():
    with pytest.raises(InputError, match=r"^ground_at = 60\.0; expected 50\.0, since trials have their own"):
        League(entrants(("ldvs",)), conditions=Conditions(ground_at=60.0))
