"""The environments' ids, registered as soon as Gymnasium is imported, by whomever and in whatever order."""

import sys
from collections.abc import Sequence
from importlib.abc import Loader
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType


class _AfterGymnasium:
    """Finds Gymnasium where Python's own finder does; others stay before it."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name == "gymnasium" else None
        if spec and spec.loader:
            spec.loader = _ThenRegister(spec.loader)
        return spec


class _ThenRegister(Loader):
    """Loads a module as another does, and imports the environments once it has run."""

    def __init__(self, loader: Loader) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        assert module.__spec__
        module.__spec__.loader = module.__loader__ = self._loader
        self._loader.exec_module(module)
        import hexmj.environments  # noqa: F401


if "gymnasium" in sys.modules:
    import hexmj.environments  # noqa: F401
else:
    _finders: list[object] = [*sys.meta_path]
    sys.meta_path.insert(_finders.index(PathFinder) if PathFinder in _finders else len(_finders), _AfterGymnasium())
