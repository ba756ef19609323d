"""A day of a geared servo with a pendulum, by equations of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from twin.foundation.compiled import jit
from twin.measurements import Channel, Recording, Trial

KP, KV, M, L, D, J = 8.0, 0.25, 0.4, 0.15, 0.03, 0.004  # N m/rad, N m s/rad, kg, m, N m s/rad, kg m^2
ARM = f"""
<mujoco>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="rod">
      <inertial pos="0 0 -{L}" mass="{M}" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="hinge" axis="0 1 0" damping="{D}" armature="{J}"/>
      <site name="tip" pos="0 0 -{L}"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="hinge" kp="{KP}" kv="{KV}"/></actuator>
</mujoco>"""
UNCERTAIN = """[parameters]
"body.rod.mass" = { relative_std = 0.03, source = "made" }
"joint.hinge.damping" = { relative_std = 0.3, source = "made" }
"joint.hinge.armature" = { relative_std = 0.3, source = "made" }
"actuator.servo.kp" = { relative_std = 0.05, source = "made" }
"""


@jit
def swing(time, command, F, presliding, stop, out):
    """Angles at `time` (n,) s: J q'' = kp (c - q) - (kv + d) q' - m g l sin q - F z, z' = q' - |q'| z / presliding, by Euler's
    method in steps of 20 us, the rate first; at the angle `stop` the rate is lost."""
    q, v, z, h = command[0], 0.0, 0.0, 2e-5
    inertia = J + M * L * L
    for i in range(-1, time.size - 1):
        t0, t1 = (time[0] - 2.0, time[0]) if i < 0 else (time[i], time[i + 1])
        for k in range(round((t1 - t0) / h)):
            c = command[0] if i < 0 else command[i] + (command[i + 1] - command[i]) * k * h / (t1 - t0)
            v += h * (KP * (c - q) - (KV + D) * v - M * 9.81 * L * np.sin(q) - F * z) / inertia
            q += h * v
            if q > stop:
                q, v = stop, 0.0
            z += h * (v - abs(v) * z) / presliding
        out[i + 1] = q


def day(folder: Path, F: float, stop: float = 10.0) -> Recording:
    rng, channels = np.random.default_rng(5), (
        Channel("actuator.servo.ctrl", "input", "rad"), Channel("joint.hinge.position", "output", "rad", 1e-3),
    )  # fmt: skip
    trials, time = [], 0.02 * np.arange(101)
    for k, (size, rate) in enumerate(
        [(0.6, 1.2), (0.9, 2.5), (0.4, 5.0), (0.8, 0.9), (0.5, 3.7), (0.7, 1.7), (0.6, 4.4), (0.3, 7.0), (0.8, 3.0)]
    ):
        command = size * np.sin(rate * time) * np.minimum(1.0, time)
        angle = np.empty_like(time)
        swing(time, command, F, 1e-3, stop, angle)
        angle += 1e-3 * rng.standard_normal(time.size)
        trials.append(Trial(f"{k}.csv", time, {"actuator.servo.ctrl": command, "joint.hinge.position": angle}, start=20.0 * k))
    return Recording(str(folder), "made", "simulation: by hand", None, channels, tuple(trials))
