"""The insect as an environment for learning and control: `dm` for dm_env, `gym` and `vector` for Gymnasium.

If Gymnasium is installed, this import registers its ids. `gymnasium.make("hexmj.environments:hexmj/StickInsect-v0")`
imports this package first.
"""

IDS = {"hexmj/StickInsect-v0": "joints", "hexmj/StickInsectTips-v0": "tips"}
"""Gymnasium's id -> kind of actions."""

try:
    from gymnasium import register
except ImportError:  # an optional dependency
    pass
else:
    for _id, _actions in IDS.items():
        register(
            _id,
            entry_point="hexmj.environments.gym:StickInsect",
            vector_entry_point="hexmj.environments.vector:StickInsects",
            kwargs={"actions": _actions},
        )
