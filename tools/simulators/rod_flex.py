"""The continuum robot with its backbone as a MuJoCo 1D flex (a discrete elastic rod): a second, finite-element formulation.

In the plane x-z of tendon 1, without friction. Each disk is a rigid body that carries two vertices of the rod, 1/6 of a pitch to
either side, so that bending sits where the chain has its hinges and EI / (l_0 + l_1) is the same; stretch is held by an edge
constraint. Disks in three dimensions would turn freely about the rod: a flex has no twist between vertices of one body.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from twin.foundation.errors import SolveError
from twin.foundation.parameters import parameter_array

TIMESTEP = 2e-3  # s
DAMPING = 1e-2  # s, of the rod: shapes at rest do not depend on it
STIFF = ("-1e9 -1e4", "0.9999 0.9999 0.001")  # solref, solimp that keep the edges' length to 0.1 %
AT_REST = 1e-3  # m/s and rad/s
LONGEST = 4000  # steps to rest


def build(structure: Mapping[str, object], values: Mapping[str, float], gravity: np.ndarray) -> mujoco.MjModel:
    """The rod, its disks at `disk_K`, tendon 1 as one motor a segment (ctrl: tension in N)."""
    n = int(structure["disks"])  # type: ignore[call-overload]
    pitch = parameter_array(values, "disks.pitch", n)
    z = np.concatenate([[0.0], np.cumsum(pitch)])
    arm = values["tendons.radius"]
    mass = (values["disks.mass"] + values["backbone.mass"]) / n
    across = mass * values["disks.radius"] ** 2 / 4.0
    carriers, vertices, disks, pulls, motors = ["world", "world"], [-pitch[0] / 6, pitch[0] / 6], [], [], []
    for k in range(1, n + 1):
        after = pitch[k] if k < n else pitch[k - 1]
        carriers += [f"disk_{k}"] * 2
        vertices += [-pitch[k - 1] / 6, after / 6]
        disks.append(
            f'<body name="disk_{k}" pos="0 0 {z[k]}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
            f'<joint type="hinge" axis="0 1 0"/><inertial pos="0 0 0" mass="{mass}" diaginertia="{across} {across} {2 * across}"/>'
            f'<geom type="cylinder" size="{values["disks.radius"]} 7.5e-4" contype="0" conaffinity="0" mass="0"/>'
            f'<site name="hole_{k}" pos="{arm} 0 0" size="5e-4"/></body>'
        )
        pulls.append(f'<spatial name="segment_{k}"><site site="hole_{k - 1}"/><site site="hole_{k}"/></spatial>')
        motors.append(f'<motor tendon="segment_{k}" gear="-1"/>')
    edges = " ".join(f"{i} {i + 1}" for i in range(len(vertices) - 1))
    points = " ".join(f"0 0 {v}" for v in vertices)
    solref, solimp = STIFF
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
<option timestep="{TIMESTEP}" integrator="discrete" solver="Newton" gravity="{gravity[0]} 0 {gravity[2]}"/>
<worldbody><site name="hole_0" pos="{arm} 0 0"/>{"".join(disks)}</worldbody>
<deformable><flex name="backbone" dim="1" radius="{values["backbone.radius"]}" body="{" ".join(carriers)}" vertex="{points}"
  element="{edges}"><elasticity young="{values["backbone.youngs_modulus"]}" poisson="{values["backbone.poisson_ratio"]}"
  damping="{DAMPING}"/><contact selfcollide="none" contype="0" conaffinity="0"/></flex></deformable>
<equality><flex flex="backbone" solref="{solref}" solimp="{solimp}"/></equality>
<tendon>{"".join(pulls)}</tendon><actuator>{"".join(motors)}</actuator></mujoco>""")


def settle(model: mujoco.MjModel, tension: np.ndarray) -> np.ndarray:
    """Disk positions (n, n_disk, 3) m at rest under the tensions (n,) N of tendon 1, one after the other.

    Raises SolveError where the rod does not come to rest.
    """
    data = mujoco.MjData(model)
    disks = [b for b in range(model.nbody) if model.body(b).name.startswith("disk_")]
    out = np.empty((len(tension), len(disks), 3))
    for i, T in enumerate(tension):
        data.ctrl[:] = T
        for k in range(1, LONGEST + 1):
            mujoco.mj_step(model, data)
            if k % 20 == 0 and np.abs(data.qvel).max() < AT_REST:
                break
        else:
            raise SolveError(f"the flex robot did not come to rest at {T:.3g} N within {LONGEST * TIMESTEP:.0f} s")
        out[i] = data.xpos[disks]
    return out
