"""A servo hexapod of 1.5 kg walks instead of the insect, with steps four times as long.

Lengths, masses and ranges come from a public description of the PhantomX (HumaRobotics, BSD). The foot's radius, the
positions of the feet, the servos and the ground are assumptions of this example.
"""

from dataclasses import asdict, dataclass, replace
from math import acos, atan2, hypot
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import hexmj
from hexmj.body import Servo
from hexmj.controllers import Controller, FeedbackPlan, Plan
from hexmj.legs import LEGS, SIDE, Geometry
from hexmj.plotting import MEASURE_STYLES

HIPS = {"1": (124.8, 61.64), "2": (0.0, 103.4), "3": (-124.8, 61.64)}  # forward, sideways from the middle [mm]
COXA, FEMUR, TIBIA, FOOT = 54.0, 66.1, 160.0, 8.0  # lengths, and the foot's radius [mm]
TRUNK, LINK = 975.6, 24.36  # masses [g]; a leg has four links
LINES = Geometry(origins=(190.0, 0.0, -190.0), lateral=(215.0, 265.0, 215.0))  # positions of the feet [mm]
HIGH = 90.0  # height of the hips above the feet [mm]
LARGER = 4.0  # length of steps and swings in those of the insect
STRIDE = hexmj.Stride(aep0=10 * LARGER, pep0=-10 * LARGER, pep_min=-20 * LARGER, dt=0.1 * LARGER, geometry=LINES)

WORLD = """
<mujoco model="servo_hexapod">
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 -9810" cone="elliptic" impratio="3"/>
  <statistic center="0 0 60" extent="500" meansize="8"/>
  <visual><headlight ambient="0.5 0.5 0.5" diffuse="0.5 0.5 0.5"/><rgba haze="0.9 0.92 0.93 1"/>
    <map znear="0.02" zfar="40"/></visual>
  <asset>
    <texture name="ground" type="2d" builtin="checker" rgb1="0.8 0.79 0.74" rgb2="0.74 0.73 0.68"
      width="256" height="256"/>
    <material name="ground" texture="ground" texrepeat="0.01 0.01" texuniform="true"/>
    <texture type="skybox" builtin="flat" rgb1="0.95 0.95 0.95" width="16" height="16"/>
  </asset>
  <default>
    <geom contype="0" conaffinity="0" type="capsule" rgba="0.25 0.27 0.3 1"/>
    <joint range="-150 150" armature="3e4"/>
  </default>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 50" material="ground" rgba="1 1 1 1"/>
    <body name="trunk" pos="0 0 {high}">
      <freejoint name="root"/>
      <camera name="following" mode="trackcom" pos="1240 -1130 720" xyaxes="0.707 0.707 0 -0.29 0.29 0.912" fovy="24"/>
      <geom name="trunk" type="box" size="135 55 22" mass="{trunk}"/>
      <geom type="box" pos="105 0 30" size="22 30 8" mass="0" rgba="0.75 0.35 0.1 1"/>
      {legs}
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0 0 {high} 1 0 0 0 {angles}"/></keyframe>
</mujoco>
"""

LEG = """
      <body name="{leg}_coxa" pos="{x} {y} 0" euler="0 0 {outward}">
        <joint name="{leg}_thorax_coxa" axis="0 0 {forward}"/>
        <geom size="14" fromto="0 0 0 {coxa} 0 0" mass="{coxa_mass}"/>
        <body name="{leg}_femur" pos="{coxa} 0 0">
          <joint name="{leg}_coxa_trochanter" axis="0 -1 0"/>
          <geom size="12" fromto="0 0 0 {femur} 0 0" mass="{link}"/>
          <body name="{leg}_tibia" pos="{femur} 0 0">
            <joint name="{leg}_femur_tibia" axis="0 -1 0" ref="180" range="10 170"/>
            <geom size="9" fromto="0 0 0 {tibia} 0 0" mass="{link}" rgba="0.55 0.57 0.6 1"/>
            <geom name="{leg}_foot" type="sphere" size="{foot}" pos="{tibia} 0 0" rgba="0.75 0.35 0.1 1" mass="0"/>
            <site name="{leg}_foot" type="sphere" size="{foot}" pos="{tibia} 0 0" group="4"/>
          </body>
        </body>
      </body>"""


def mjcf() -> str:
    """Return the robot's MJCF; at home its feet stand on the origins of their lines."""
    legs, angles = "", []
    sizes = {"coxa": COXA, "femur": FEMUR, "tibia": TIBIA, "foot": FOOT, "link": LINK, "coxa_mass": 2 * LINK}
    for leg, side, ahead, beside in zip(LEGS, SIDE, LINES.origin, LINES.y, strict=True):
        x, y = HIPS[leg[1]]
        legs += LEG.format(leg=leg, x=x, y=side * y, outward=90 * side, forward=-side, **sizes)
        forward, outward = ahead - x, side * beside - y
        along = hypot(forward, outward) - COXA
        far = hypot(along, HIGH)  # of the triangle of femur and tibia
        lifted = acos((FEMUR**2 + far**2 - TIBIA**2) / (2 * FEMUR * far))
        bent = acos((FEMUR**2 + TIBIA**2 - far**2) / (2 * FEMUR * TIBIA))
        angles += [atan2(forward, outward), atan2(-HIGH, along) + lifted, bent]
    return WORLD.format(high=HIGH + FOOT, trunk=TRUNK, legs=legs, angles=" ".join(map(str, angles)))


def robot(folder: Path) -> hexmj.Body:
    """Write the MJCF into a folder and return the robot's description."""
    file = folder / "servo_hexapod.xml"
    file.write_text(mjcf(), encoding="utf-8")
    insect = hexmj.STICK_INSECT
    discs = {"rim": (16.0, 2.0), "centre": (11.0, 2.6)}
    return replace(
        insect,
        name="servo_hexapod",
        mjcf=file,
        root="trunk",
        trunk=("trunk",),
        cameras=("following",),
        lines=LINES,
        standing_height=HIGH,
        longest_step=0.001,
        mass=TRUNK + 6 * 4 * LINK,
        servo=Servo(step=0.004, damping_ratio=1.0, digits=2),
        lengths=insect.lengths.scaled(8.0),
        marks=replace(insect.marks, fill_height=0.3, outline=3.0, plumb_line=0.9, tip=7.0, **discs),
    )


def conditions(body: hexmj.Body, vp: float) -> hexmj.Conditions:
    """Return conditions: feet are lifted by 40 mm and swing with V_p [mm/s]."""
    path: dict[str, Any] = {
        "standing_height": HIGH,
        "step_height": 10 * LARGER,
        "lift_time": 40.0,
        "landing_time": 40.0,
    }
    return hexmj.Conditions(body=body, vp=vp, longest_substep=1.0, **path)


@dataclass(frozen=True)
class Larger:
    """A controller with weights in the insect's millimetres, whose steps are scaled."""

    of: Controller = hexmj.LDVS
    times: float = LARGER
    name: str = "ldvs, larger"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """Begin a plan, see `hexmj.controllers.Controller`; sensory feedback is not supported."""
        small = {name: getattr(stride, name) / self.times for name in ("aep0", "pep0", "pep_min", "dt")}
        lines = {name: tuple(np.divide(ends, self.times).tolist()) for name, ends in asdict(stride.geometry).items()}
        small["geometry"] = Geometry(**lines)
        faster = acceleration and replace(acceleration, rate=acceleration.rate * self.times)
        plan = self.of.begin(starts / self.times, velocity, replace(stride, **small), faster, threads)
        if isinstance(plan, FeedbackPlan):
            raise hexmj.InputError(f"{self.of.name} has sensory feedback; expected a controller without it")
        return LargerPlan(plan, starts, stride, self.times)


@dataclass
class LargerPlan:
    """Another plan in longer steps that take longer."""

    plan: Plan
    starts: np.ndarray
    stride: hexmj.Stride
    times: float
    done: int = 0

    def advance(self, steps):
        """Plan the next steps."""
        self.done += steps
        walk = self.plan.advance(steps)
        larger = {name: self.times * getattr(walk, name) for name in ("time", "x", "y", "aep", "height")}
        return replace(walk, geometry=self.stride.geometry, **larger)


def fallen(walks: dict[float, dict[str, Any]], n_starts: int, velocity: float = 0.5) -> xr.Dataset:
    """Compare the same starts at some swing velocities V_p [mm/s] -> arguments of `hexmj.compare`."""
    results = [hexmj.compare(velocities=velocity, n_starts=n_starts, **settings) for settings in walks.values()]
    return xr.concat(
        [result.squeeze() for result in results], xr.Variable("vp", list(walks)), combine_attrs="drop_conflicts"
    )


def tilting(body: hexmj.Body) -> xr.Dataset:
    """Record a start whose plan lifts too many legs."""
    start, slow = hexmj.draw_starts(6, seed=0, stride=STRIDE)[5:], conditions(body, 160.0)
    walked = hexmj.physical_walk(start, Larger(), 0.5, 300.0, conditions=slow, stride=STRIDE)
    return hexmj.record(walked, title="servo hexapod")


def main(n_starts: int = 40) -> None:
    """Walk insect and robot at several swing velocities, draw the falls, and film the robot."""
    out = Path("results/examples")
    out.mkdir(parents=True, exist_ok=True)
    body = robot(out)
    walks = {
        "stick insect": {
            vp: {"controllers": hexmj.LDVS, "conditions": hexmj.Conditions(vp=vp)} for vp in (20.0, 40.0, 80.0, 160.0)
        },
        "servo hexapod": {
            vp: {"controllers": Larger(), "stride": STRIDE, "conditions": conditions(body, vp)}
            for vp in (40.0, 80.0, 160.0, 320.0)
        },
    }
    figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    for axes, (name, cells) in zip(panels, walks.items(), strict=True):
        answers = fallen(cells, n_starts)
        tilted = (answers.tilt > 0.1).mean("start"), {"color": "#6a4c93", "label": "trunk tilts by over 0.1 rad"}
        curves = [(answers[measure], MEASURE_STYLES[measure]) for measure in ("kinematic", "physical")]
        for values, style in [*curves, tilted]:
            axes.plot(answers.vp, values, **style)
            print(f"{name}, {style['label']}: {dict(zip(cells, values.values.round(3).tolist(), strict=True))}")
        axes.set(title=f"{name}, V = 0.5", xscale="log", xlabel="swing velocity V_p [mm/s]", ylim=(-0.03, 1))
        axes.set_xticks(list(cells), [f"{vp:g}" for vp in cells], minor=False)
        axes.minorticks_off()
    panels[0].set_ylabel(f"share of {n_starts} starts")
    panels[1].legend(frameon=False)
    figure.savefig(out / "servo_hexapod.png", dpi=150)
    hexmj.render([tilting(body)], out / "servo_hexapod.mp4", body=body)
    print(f"{out}/servo_hexapod.png and .mp4")


if __name__ == "__main__":
    main()
