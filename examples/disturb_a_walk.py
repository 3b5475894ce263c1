"""Halt an insect in mid-stride. The walk restarts from this posture, or the legs first move to another posture."""

import hexmj

tasks = [
    hexmj.Task("legs as they stand", 0.6, events=(hexmj.Halt(),), duration=150.0),
    hexmj.Task("legs reorganised", 0.6, events=(hexmj.Halt(answer="reorganise"),), duration=150.0),
]

if __name__ == "__main__":
    result = hexmj.run_task(tasks, hexmj.LDVS, n_starts=12, seed=0)
    for name in result.task.values:
        halted = result.sel(task=name, controller="ldvs")
        rest, lose, fall = (halted.back - halted.event).mean(), halted.lost * 12, halted.fell * 12
        print(f"{name}: rest {rest:.0f} time units, {lose:.0f} of 12 lose static stability, {fall:.0f} fall")
