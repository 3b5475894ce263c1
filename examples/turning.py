"""A controller that turns: the feet in stance move on circles about a point beside the insect."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.rotations import heading

TRIPODS = np.array([0, 2, 4]), np.array([1, 3, 5])
NEAR = 2.0  # distance from the ends of the step range, where legs cannot reach sideways [mm]


@dataclass(frozen=True)
class Turning:
    """Two tripods in turn walk on a circle; a positive curvature turns to the left [1/mm]."""

    curvature: float = 0.008
    name: str = "turning"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """Begin a plan, see `hexmj.controllers.Controller`."""
        origin, line, dt = np.array(stride.geometry.origin), np.array(stride.geometry.y), stride.dt
        front, rear = stride.aep0 - NEAR, stride.pep0 + NEAR
        lands_at = (
            line + self.curvature * origin * (front - rear) / 2
        )  # beside the body, to be at the line in mid-stance
        x, y, stands = starts, np.broadcast_to(line, starts.shape), np.ones(starts.shape, dtype=bool)

        def step(v):
            nonlocal x, y, stands
            way = v[:, None] * dt
            turn = self.curvature * way  # of the body's heading [rad]
            to_go = np.minimum(dt / np.maximum(front - x, dt), 1)  # part of a swing's way that this step takes
            stands = stands | (x >= front)
            for tripod in TRIPODS:
                tips = x[:, tripod]
                at_the_rear = (tips.mean(axis=1) <= rear) | (tips - 2 * way < stride.pep_min).any(axis=1)
                stands[np.ix_(stands.all(axis=1) & at_the_rear, tripod)] = False
            circle = np.stack([x - way + turn * y, y - turn * (origin + x)])
            standing = np.where(circle[0] < stride.pep_min, (x, y), circle)
            swinging = np.maximum(x, np.minimum(x + dt, front)), y + (lands_at - y) * to_go
            x, y = np.where(stands, standing, swinging)
            return Step(x, stands, y=y, aep=front)

        return stepwise(step, starts, velocity, stride, acceleration)


def main() -> None:
    """Walk to the left, straight ahead and to the right, and print by how much the insect turned."""
    starts = hexmj.draw_starts(1, seed=0)
    out = Path("results/examples")
    out.mkdir(parents=True, exist_ok=True)
    for curvature in (0.008, 0.0, -0.008):
        walked = hexmj.physical_walk(starts, Turning(curvature), velocity=0.5, duration=200.0)
        recording = hexmj.record(walked, title=f"curvature {curvature:g} per mm")
        way = 0.5 * recording.time.values[-1]  # mm
        turned = np.unwrap(heading(recording.qpos.values[:, 3:7]))[-1]
        print(f"curvature {curvature:g} per mm: turned {turned:.2f} rad in {way:g} mm, planned {curvature * way:.2f}")
        hexmj.save_recording(recording, out / f"turning_{curvature:g}.nc")


if __name__ == "__main__":
    main()
