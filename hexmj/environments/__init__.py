"""The insect as an environment for learning and control: `dm` for dm_env, `gym` and `vector` for Gymnasium.

Where Gymnasium is installed, its ids are registered when this package is imported.
"""

from importlib.util import find_spec

IDS = {"hexmj/StickInsect-v0": "joints", "hexmj/StickInsectTips-v0": "tips"}
"""What an action means, by Gymnasium's ids."""

if find_spec("gymnasium"):
    import gymnasium

    for _id, _actions in IDS.items():
        gymnasium.register(
            _id,
            entry_point="hexmj.environments.gym:StickInsect",
            vector_entry_point="hexmj.environments.vector:StickInsects",
            kwargs={"actions": _actions},
        )
