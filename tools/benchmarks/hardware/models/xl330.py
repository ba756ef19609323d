"""A Dynamixel XL330 servo that swings a pendulum (Rhoban/bam, Apache-2.0): twelve logs at three gains are fitted, four judged.

The firmware's law is duty = clip(gain (goal - q) 4096 / (2 pi 256 885), -1, 1), and torque = kt U duty / R - kt^2 / R q' while it
is switched on. Its gain is another in each log, so the torque is made of three controls: gain times goal, the gain over the angle,
and the back-EMF's damping. The first two act through a tendon of which `actuatorfrcrange` is the clip. kt and R are those of the
data sheet's stall (XL330-M288: 0.52 N m, 1.47 A at 5 V).
"""

import gzip
import json
from pathlib import Path

import numpy as np

from twin.measurements import Channel, Recording, Trial, write
from twin.prediction.twin import Twin

KT, R, NOMINAL = 0.52 / 1.47, 5.0 / 1.47, 7.4  # N m/A, ohm, V
STALL = KT * NOMINAL / R  # N m
FIRMWARE = 4096.0 / (2.0 * np.pi) / (256.0 * 885.0)  # duty per rad and unit of gain
JUDGED_GAIN = 400
ENCODER = 2.0 * np.pi / 4096.0 / np.sqrt(12.0)  # rad
MODEL = f"""<mujoco model="xl330_pendulum">
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="pendulum">
      <inertial pos="0 0 -0.1" mass="0.49" diaginertia="1e-6 1e-6 1e-6"/>
      <joint name="output" axis="0 -1 0" armature="0.002" damping="0.005"/>
      <site name="tip" pos="0 0 -0.1"/>
    </body>
  </worldbody>
  <tendon><fixed name="bridge" actuatorfrcrange="{-STALL} {STALL}"><joint joint="output" coef="1"/></fixed></tendon>
  <actuator>
    <motor name="goal" tendon="bridge"/>
    <general name="stiffness" tendon="bridge" gaintype="affine" gainprm="0 -1 0"/>
    <general name="back_emf" joint="output" gaintype="affine" gainprm="0 0 -1"/>
  </actuator>
</mujoco>
"""
ROBOT = """format = "twin-robot/1"
family = "mjcf"
title = "XL330 servo with a pendulum"
accuracy = { value = 0.1, unit = "mm", source = "weighed and measured by its owners" }
[structure]
model = "model.xml"
[parameters]
"body.pendulum.mass" = { relative_std = 0.02, source = "assumed: weighed" }
"body.pendulum.ipos" = { std = [0, 0, 2], unit = "mm", source = "assumed: measured" }
"joint.output.armature" = { relative_std = 0.5, source = "assumed" }
"joint.output.damping" = { relative_std = 0.5, source = "assumed" }
"""


def write_sets(raw: Path, folder: Path) -> tuple[Path, Path]:
    """Write the fitted and the judged set, with the robot, from the raw logs; return their folders."""
    robot = folder / "robot"
    robot.mkdir(parents=True, exist_ok=True)
    (robot / "model.xml").write_text(MODEL)
    (robot / "robot.toml").write_text(ROBOT)
    trials: dict[bool, list[Trial]] = {True: [], False: []}
    for path in sorted(raw.glob("*.json.gz")):
        log = json.loads(gzip.decompress(path.read_bytes()))
        trials[log["kp"] == JUDGED_GAIN].append(_trial(log))
    channels = (
        Channel("goal", "input", "N*m", quantity="actuator.goal.ctrl"),
        Channel("stiffness", "input", "1", quantity="actuator.stiffness.ctrl"),
        Channel("back_emf", "input", "1", quantity="actuator.back_emf.ctrl"),
        Channel("angle", "output", "rad", ENCODER, "joint.output.position"),
    )
    made = []
    for judged, name in ((False, "fitted"), (True, "judged")):
        source = "hardware: Rhoban/bam, XL330, Apache-2.0"
        write(Recording("../robot", f"XL330 pendulum, {name}", source, None, channels, tuple(trials[judged])), folder / name)
        made.append(folder / name)
    return made[0], made[1]


def _trial(log: dict) -> Trial:  # type: ignore[type-arg]
    rows = {
        k: np.array([e[k] for e in log["entries"]], float)
        for k in ("timestamp", "position", "goal_position", "input_volts", "torque_enable")
    }
    time = rows["timestamp"] - rows["timestamp"][0]
    keep = np.append(True, np.diff(time) > 0.0)
    rows = {k: v[keep] for k, v in rows.items()}
    gain = log["kp"] * FIRMWARE * KT * log["vin"] / R * rows["torque_enable"]
    values = {
        "goal": gain * rows["goal_position"], "stiffness": gain, "back_emf": KT**2 / R * rows["torque_enable"],
        "angle": rows["position"],
    }  # fmt: skip
    return Trial(f"kp{log['kp']}_{log['trajectory']}.csv", time[keep], values)


def judge(twin: Twin, described: Twin, judged: Recording) -> str:
    """Return the mean absolute error (mrad) on the judged logs, as described and by the twin."""

    def error(one: Twin) -> float:
        seen = one.predict(judged)
        return float(
            np.mean([np.abs(a.values["angle"] - b.values["angle"]).mean() for a, b in zip(judged.trials, seen.trials, strict=True)])
        )

    return f"gain {JUDGED_GAIN}, MAE: described {1e3 * error(described):.1f}, twin {1e3 * error(twin):.1f} mrad (bar 36)"
