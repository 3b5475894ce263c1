"""`Recording`, the dataset of one walk, and its table with one row for each step of the plan."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from hexmj.body import ROOT_QPOS
from hexmj.errors import InputError
from hexmj.files import write_text

COLUMNS = {
    "seconds": "time [s]", "time": "time [time units]", "velocity": "velocity [V_p]",
    "planned_margin": "planned margin [mm]", "grounded_margin": "grounded margin [mm]",
    "root": "root {pose}", "centre_of_mass": "centre of mass {coordinate} [mm]",
    "joint_angle": "{joint} [rad]", "joint_torque": "{joint} torque [mN mm]",
    "planned_stance": "{leg} planned stance", "measured_stance": "{leg} contact",
    "grounded_stance": "{leg} at the ground",
    "planned_tip": "{leg} planned {coordinate} [mm]", "tip": "{leg} tip {coordinate} [mm]",
    "ground_force": "{leg} force {coordinate} [mN]",
}  # fmt: skip
"""Variable of a recording -> names of its columns, in which the labels of its axes replace the braces."""


class Recording(xr.Dataset):
    """The recording of one walk: an `xarray.Dataset` whose table has one row for each step of the plan."""

    __slots__ = ()

    def to_dataframe(self) -> pd.DataFrame:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the table of all variables over the steps, without those that the recording does not have.

        Each column's name ends with its unit, such as "L1 force z [mN]". A contact or a stance is True or False. After
        a fall, poses, forces and measures are NaN.

        Raises:
            InputError: the recording has no dimension `step`.
        """
        if "step" not in self.dims:
            raise InputError("the recording has no dimension 'step'; select steps with a slice: isel(step=slice(4, 5))")
        data, columns = self, {}
        if "qpos" in self:
            data = self.assign_coords(pose=["x [mm]", "y [mm]", "z [mm]", "qw", "qx", "qy", "qz"])
            data = data.assign(root=(("step", "pose"), self["qpos"].values[:, :ROOT_QPOS]))
        for variable in (name for name in COLUMNS if name in data.variables):
            values = data[variable].transpose("step", ...)
            for index in np.ndindex(values.shape[1:]):
                column = values[:, *index]
                labels = {str(name): label.item() for name, label in column.coords.items() if not label.dims}
                columns[COLUMNS[variable].format(**labels)] = column.values
        return pd.DataFrame(columns)

    def to_csv(self, path: Path | str) -> Path:
        """Write the table as CSV: contacts and stances as 0 or 1, NaN as an empty cell. Return the path.

        Raises:
            InputError: see `to_dataframe`.
        """
        frame = self.to_dataframe()
        return write_text(path, frame.astype({name: int for name in frame.select_dtypes(bool)}).to_csv(index=False))
