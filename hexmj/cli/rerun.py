"""`hexmj rerun`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tyro.conf import Positional

from hexmj.errors import InputError
from hexmj.files import read_netcdf
from hexmj.io import MANIFEST, read_manifest


@dataclass(frozen=True)
class Rerun:
    """Options of `hexmj rerun`, which `commands.COMMANDS` describes."""

    result: Positional[Path]
    """A directory that a command wrote results to, or one manifest in it."""

    def run(self) -> None:
        """Repeat the command in a temporary directory and compare all NetCDF files; exit code 1 if any differs."""
        import xarray as xr

        from hexmj.cli.commands import options_of

        path = self.result if self.result.is_file() else self.result / MANIFEST
        manifest = read_manifest(path)
        names = [name for name in manifest["files"] if name.endswith(".nc")]
        if not names:
            raise InputError(f"{path} names no NetCDF file to compare")
        arguments = list(manifest["command"])
        if "--out" in arguments:
            at = arguments.index("--out")
            del arguments[at : at + 2]
        equal = True
        with TemporaryDirectory(prefix="hexmj-rerun-") as folder:
            options_of([*arguments, "--out", folder]).run()
            for name in names:
                try:
                    xr.testing.assert_identical(read_netcdf(path.parent / name), read_netcdf(Path(folder) / name))
                    print(f"{name}: equal")
                except AssertionError as error:
                    equal = False
                    print(f"{name}: {error}")
        sys.exit(0 if equal else 1)
