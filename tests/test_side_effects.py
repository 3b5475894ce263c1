"""`import hexmj` and a walk leave the process as it was."""

import subprocess
import sys

SCRIPT = """
import gc, os, signal, sys, threading, warnings
import matplotlib, mujoco, mujoco.rollout, numba, numpy, scipy.spatial, scipy.stats, xarray

added = []
sys.addaudithook = lambda hook: added.append(hook)
os.register_at_fork = lambda **hooks: added.append(hooks)


def state():
    return {
        "meta_path": list(sys.meta_path), "path_hooks": list(sys.path_hooks), "path": list(sys.path),
        "signals": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "environ": dict(os.environ), "gc": (gc.isenabled(), gc.get_threshold(), gc.get_freeze_count()),
        "warnings": list(warnings.filters),
        "excepthooks": (sys.excepthook, threading.excepthook, sys.unraisablehook),
    }


before = state()
import hexmj

starts = hexmj.draw_starts(2, seed=0)
hexmj.walk(starts, hexmj.LDVS, velocity=0.5, duration=10.0)
hexmj.physical_walk(starts, hexmj.LDVS, velocity=0.5, duration=10.0)
after = state()
print([name for name in before if before[name] != after[name]], len(added))
"""


def test_import_and_walks_leave_the_process_as_it_was():
    """Third-party packages are imported first, since some of them do change the process."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[] 0"
