"""Family "transmission": a rigid jaw at the end of a shaft, turned by two antagonist tendons from a drum at the other end.

In MuJoCo the jaw is one hinge with a pulley. Each tendon runs along the shaft and a quarter turn over the pulley to its anchor, so
its moment arm is the pulley's radius from -90 to +90 deg. Each tendon has a motor, ctrl = tension (N) at the pulley.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from twin.body import Body, Drive, Port, Problem, Sense, Solution
from twin.mechanics.rod.antagonists import TendonPair, solve_jaw
from twin.robots.schemas.transmission import TRANSMISSION_SCHEMA as SCHEMA
from twin.robots.schemas.transmission import Transmission

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]

JAW_COLOUR = [0.72, 0.74, 0.78, 1.0]
JAW_TIMESTEP = 1e-3  # s
ANCHOR_RADIUS = 1.001  # of the pulley's radius: an anchor inside the pulley would not be wrapped


@dataclass(frozen=True, kw_only=True)
class Jaw(Body):
    """A rigid jaw on one hinge, turned by a pair of antagonist tendons from a drum.

    A drum angle q (rad) pulls tendon 1 in by drum q (m) and pays tendon 2 out by as much. A jaw angle a (rad) takes
    pulley (a - rest) of tendon 1 and gives as much of tendon 2.
    """

    drum: float  # m, radius
    pulley: float  # m, radius; negative if the tendons cross
    rest: float  # rad
    wrap: float  # rad that each tendon turns over idlers
    pretension: float  # N of both tendons at rest
    stretch: float  # m/N


class Antagonists:
    """Static solver of a jaw. A jaw is rigid: it does not creep and has no stiffness of its own."""

    n_delayed = 0

    def __init__(self, body: Jaw) -> None:
        self.body = body
        self.straight_path = np.zeros(2)

    def solve(self, problem: Problem) -> Solution:
        """Solve for equilibrium under displacements (n, 2) m and the loads' torque.

        The solution shows the angles (n, 2) rad of drum and jaw, and the external torques (n, 2) N m on them.
        """
        body, route, u = self.body, problem.route, problem.command
        torque = np.broadcast_to(np.asarray(problem.loads.torque, float), len(u))
        arm = abs(body.pulley)
        pair = TendonPair(
            body.pretension, body.stretch + route.stretch, route.bedding, route.bedding_tension, route.mu * body.wrap,
            route.presliding, route.bearing.presliding * arm,
        )  # fmt: skip
        friction = route.bearing.friction_torque(drum_rate(u, problem.time) / arm) / arm
        y, tension, status = solve_jaw(u, torque / body.pulley, friction, pair)
        q = body.rest + y / body.pulley
        drum = 0.5 * (u[:, 0] - u[:, 1]) / body.drum  # a shortening common to both tendons is slack
        others = {
            "angle": np.column_stack([drum, q]),
            "torque": np.column_stack([body.drum * (tension[:, 0] - tension[:, 1]), torque]),
        }
        return Solution(
            tension=tension, path=np.column_stack([-y, y]), markers=np.empty((len(u), 0, 3)), status=status, q=q[:, None],
            others=others,
        )  # fmt: skip


def drum_rate(u: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the speed (n,) m/s of a drum's two tendons, over three rows, to reduce the encoder's noise."""
    return np.gradient(0.5 * (u[:, 0] - u[:, 1]), time) if len(u) > 1 else np.zeros(len(u))


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> Jaw:
    """Build an editable MuJoCo model from `structure` and `values` (SI, by parameter name; see `twin.robots.schemas.transmission`).

    Base frame: origin at the drum's end of the shaft, +z along it; the jaw turns about y.
    """
    crossed = Transmission.model_validate(dict(structure)).crossed
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep, spec.option.gravity = JAW_TIMESTEP, [0, 0, 0]
    radius, length = values["pulley.radius"], values["shaft.length"]
    visual = {"contype": 0, "conaffinity": 0, "mass": 0, "rgba": JAW_COLOUR}
    along_y = [math.sqrt(0.5), math.sqrt(0.5), 0, 0]  # quaternion of a cylinder
    cylinder, capsule = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE
    spec.worldbody.add_geom(type=cylinder, size=[values["drum.radius"], radius, 0], quat=along_y, **visual)
    spec.worldbody.add_geom(type=cylinder, size=[0.3 * radius, 0.5 * length, 0], pos=[0, 0, 0.5 * length], **visual)
    jaw = spec.worldbody.add_body(name="jaw", pos=[0, 0, length])
    jaw.add_joint(name="joint_2", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], ref=values["jaw.rest"])
    jaw.add_geom(name="pulley", type=cylinder, size=[radius, 0.5 * radius, 0], quat=along_y, **visual)
    blade = {**visual, "mass": values["jaw.mass"]}
    jaw.add_geom(type=capsule, size=[0.3 * radius, 0, 0], fromto=[0, 0, 0, 0, 0, values["jaw.length"]], **blade)
    jaw.add_site(name="jaw_tip", pos=[0, 0, values["jaw.length"]], size=[5e-4, 0, 0])
    for i, side in ((1, -1.0 if crossed else 1.0), (2, 1.0 if crossed else -1.0)):
        base, anchor, side_site = f"tendon_{i}_base", f"tendon_{i}_anchor", f"tendon_{i}_side"
        spec.worldbody.add_site(name=base, pos=[side * radius, 0, 0], size=[5e-4, 0, 0])
        spec.worldbody.add_site(name=side_site, pos=[2 * side * radius, 0, length + 2 * radius], size=[1e-4, 0, 0])
        jaw.add_site(name=anchor, pos=[0, 0, ANCHOR_RADIUS * radius], size=[5e-4, 0, 0])
        tendon = spec.add_tendon(name=f"tendon_{i}", width=2.5e-4, rgba=[0.85, 0.6, 0.15, 1])
        tendon.wrap_site(base)
        tendon.wrap_geom("pulley", side_site)
        tendon.wrap_site(anchor)
        motor = spec.add_actuator(name=f"tendon_{i}", target=f"tendon_{i}", trntype=mujoco.mjtTrn.mjTRN_TENDON)
        motor.gear = [-1, 0, 0, 0, 0, 0]
    drum = values["drum.radius"]
    return Jaw(
        spec=spec,
        n_tendon=2,
        features=frozenset({"antagonists", "rope", "lines", "friction of joints"}),
        antagonists=True,
        tendon_sites=tuple((f"tendon_{i}_base", f"tendon_{i}_anchor") for i in (1, 2)),
        ports=((Port("joint_1_angle", Drive.DISPLACEMENT, (drum, -drum)),),),
        senses={
            **{f"tendon_{i}_{group}": Sense(group, i - 1) for i in (1, 2) for group in ("tension", "displacement")},
            "joint_2_angle": Sense("angle", 1),
            "joint_1_torque": Sense("torque", 0),
        },
        load_channels={"joint_2_torque": "torque"},
        drum=drum,
        pulley=-radius if crossed else radius,
        rest=values["jaw.rest"],
        wrap=values["tendons.wrap"],
        pretension=values["tendons.pretension"],
        stretch=values["tendons.stretch"],
    )


statics, dynamics = Antagonists, None  # statics only
figure = chain = silicone = hand = None
