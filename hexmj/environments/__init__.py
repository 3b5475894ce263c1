"""Environments for learning and control: `dm` for dm_env, `gym` for Gymnasium, and `stable_baselines`.

Importing this package registers the ids of `IDS` if Gymnasium is installed. The prefix in
`gymnasium.make("hexmj.environments:hexmj/StickInsect-v0")` makes Gymnasium import it.
"""

IDS = {"hexmj/StickInsect-v0": "joints", "hexmj/StickInsectTips-v0": "tips"}
"""Environment id in Gymnasium -> kind of actions, see `task.Actions`."""

try:
    from gymnasium import register
except ImportError:  # Gymnasium is optional
    pass
else:
    for _id, _actions in IDS.items():
        register(
            _id,
            entry_point="hexmj.environments.gym:StickInsect",
            vector_entry_point="hexmj.environments.gym:StickInsects",
            kwargs={"actions": _actions},
        )
