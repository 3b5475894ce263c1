"""Sweeps: many cells, each a pure function of plain settings, computed anywhere and kept as they finish.

A folder of a sweep holds

- `<name>-<digest>.nc` for each finished cell: NetCDF 4, then the line ``hexmj, sha256 <checksum>``.  Its
  attribute `cell` is the record of all that its numbers depend on, as JSON: the `function`, whose it is (`of`), the
  `settings`, the `sources` of every module within reach (module -> digest) and the `versions` of Python and of the
  packages that compute.  The digest in the name is that of the record, so an edit, another version or another setting
  is another file, and one that is damaged or foreign is refused.  Its attribute `read` tells what else the code has
  read, as `Cell.read` does; where that is not what it was, the cell is made anew and takes the place of the old one.
- `<name>-<digest>.jsonl` for each `KeptValues`: the same record, then a line for each value, with what was read for it.
- `.part-*` of runs that were killed while they wrote; the next run removes them.

There is no index: the names are all that a run needs to go on, and several runs may share a folder.
"""

from hexmj.sweeps.cells import Cell as Cell
from hexmj.sweeps.grid import Execution as Execution
from hexmj.sweeps.grid import Study as Study
from hexmj.sweeps.grid import conduct as conduct
from hexmj.sweeps.grid import finish as finish
from hexmj.sweeps.grid import over_axes as over_axes
from hexmj.sweeps.grid import run as run
from hexmj.sweeps.kept_values import KeptValues as KeptValues
