"""The environments' ids, registered as soon as Gymnasium is imported, by whomever and in whatever order."""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType


class _AfterGymnasium:
    """Finds Gymnasium where the others find it, and imports the environments once it has run."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        found = (one.find_spec(name, path, target) for one in sys.meta_path if one is not self)
        spec = next(filter(None, found), None)
        if spec and spec.loader:
            run = spec.loader.exec_module

            def run_and_register(module: ModuleType) -> None:
                run(module)
                import hexmj.environments  # noqa: F401

            spec.loader.exec_module = run_and_register
        return spec


if "gymnasium" in sys.modules:
    import hexmj.environments  # noqa: F401
else:
    sys.meta_path.insert(0, _AfterGymnasium())
