"""The insect as an environment for learning and control: `dm` for dm_env, `gym` and `vector` for Gymnasium.

Where Gymnasium is installed, its ids are registered when this package is imported.
"""

IDS = {"hexmj/StickInsect-v0": "joints", "hexmj/StickInsectTips-v0": "tips"}
"""What an action means, by Gymnasium's ids."""

try:
    from gymnasium import register
except ImportError:  # it is not installed
    pass
else:
    for _id, _actions in IDS.items():
        register(
            _id,
            entry_point="hexmj.environments.gym:StickInsect",
            vector_entry_point="hexmj.environments.vector:StickInsects",
            kwargs={"actions": _actions},
        )
