"""A body that is an MJCF: a compiled model that effects change, the channels of its elements, and its size."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from twin.body import Body, Sense
from twin.body.hinge_chain import REFERENCE_SIZE
from twin.effects.joint_stop import NO_STOP
from twin.foundation.parameters import Size
from twin.mechanics.mjcf.loading import SCALAR_JOINTS, LoadedModel
from twin.mechanics.mjcf.numbers import slides
from twin.mechanics.mjcf.poses import touching_bodies
from twin.mechanics.mjcf.routes import outward

LINE_LAG = 9  # of an actuator's dynprm, all of which MuJoCo leaves alone where it has no dynamics: s, `line_lag`
LEAST_TRAVEL = 1e-4  # rad or m between a joint's stops
FARTHEST_REST = 1e3  # rad or m: the push of a spring that rests so far away changes by a thousandth over a rad or m
HARD_STOP = ((0.004, 1.0), (0.99, 0.999, 1e-4, 0.5, 2.0))  # solref, solimp: without bounce, milliradians soft under a light link
SPRING_SWING = 0.5  # rad (or a tenth of that in m): the deflection of a spring that gives a joint its scale of torque
# group of signals of what turns, of what slides or pulls, and their SI units
_JOINT_GROUPS = {
    "position": ("joint angle", "joint shift"), "velocity": ("joint rate", "joint speed"),
    "torque": ("joint torque", "joint force"),
}  # fmt: skip
_ACTUATOR_GROUPS = {
    "position": ("actuator angle", "actuator length"), "velocity": ("actuator rate", "actuator speed"),
    "force": ("actuator torque", "actuator force"),
}  # fmt: skip
_PORT_UNITS = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "torque": ("N*m", "N"), "force": ("N*m", "N")}
_S = mujoco.mjtSensor
SENSOR_UNITS = {
    _S.mjSENS_JOINTPOS: "rad", _S.mjSENS_JOINTVEL: "rad/s", _S.mjSENS_TENDONPOS: "m", _S.mjSENS_TENDONVEL: "m/s",
    _S.mjSENS_ACTUATORPOS: "m", _S.mjSENS_ACTUATORVEL: "m/s", _S.mjSENS_ACTUATORFRC: "N", _S.mjSENS_FORCE: "N",
    _S.mjSENS_TORQUE: "N*m", _S.mjSENS_TOUCH: "N", _S.mjSENS_ACCELEROMETER: "m/s^2", _S.mjSENS_VELOCIMETER: "m/s",
    _S.mjSENS_GYRO: "rad/s", _S.mjSENS_FRAMEPOS: "m", _S.mjSENS_FRAMELINVEL: "m/s", _S.mjSENS_FRAMEANGVEL: "rad/s",
    _S.mjSENS_FRAMELINACC: "m/s^2", _S.mjSENS_FRAMEANGACC: "rad/s^2", _S.mjSENS_SUBTREECOM: "m",
}  # fmt: skip


def sensor_unit(model: mujoco.MjModel, k: int) -> str:
    """Return the SI unit of a sensor's readings: of what turns, or of what slides, where its element tells."""
    kind, element = _S(int(model.sensor_type[k])), int(model.sensor_objid[k])
    unit = SENSOR_UNITS.get(kind, "1")
    if kind in (_S.mjSENS_JOINTPOS, _S.mjSENS_JOINTVEL) and slides(model, "joint", element):
        return unit.replace("rad", "m")
    if kind in (_S.mjSENS_ACTUATORPOS, _S.mjSENS_ACTUATORVEL, _S.mjSENS_ACTUATORFRC) and not slides(model, "actuator", element):
        return {"m": "rad", "m/s": "rad/s", "N": "N*m"}[unit]
    return unit


def control_unit(model: mujoco.MjModel, k: int) -> str:
    """Return the SI unit of an actuator's control: of a position, a rate, or a torque; "1" where its gain is none of a motor."""
    if model.actuator_gaintype[k] != int(mujoco.mjtGain.mjGAIN_FIXED):
        return "1"
    sliding, bias = slides(model, "actuator", k), model.actuator_biasprm[k]
    kind = "position" if bias[1] != 0.0 else "velocity" if bias[2] != 0.0 else "force"
    return _PORT_UNITS[kind][sliding]


def control_span(model: mujoco.MjModel, k: int) -> tuple[float, float, float]:
    """Return the least, resting and greatest control of an actuator by its ctrlrange, else by its joint's or its force's range.

    It rests where the first keyframe has it, else at the allowed value nearest to where a servo does not pull in the model's
    reference pose, zero for others. Ends that nothing bounds are infinite.
    """
    joint, gear, bias = int(model.actuator_trnid[k, 0]), float(model.actuator_gear[k, 0]), model.actuator_biasprm[k]
    of_joint = model.actuator_trntype[k] == int(mujoco.mjtTrn.mjTRN_JOINT) and bias[1] < 0.0
    gain, unit = float(model.actuator_gainprm[k, 0]), control_unit(model, k)
    ends: Sequence[float] = (-np.inf, np.inf)
    if model.actuator_ctrllimited[k]:
        ends = model.actuator_ctrlrange[k]
    elif of_joint and model.jnt_limited[joint]:
        ends = gear * model.jnt_range[joint]
    elif model.actuator_forcelimited[k] and unit in ("N", "N*m") and gain:
        ends = model.actuator_forcerange[k] / gain
    servo, held = unit in ("rad", "m") and gain != 0.0, bias[0] + bias[1] * model.actuator_length0[k]
    if servo and np.isinf(ends[0]) and model.actuator_forcelimited[k]:
        ends = (model.actuator_forcerange[k] - held) / gain  # where it pulls most in that pose
    low, high = float(min(ends)), float(max(ends))
    rest = -held / gain if servo else 0.0
    rest = float(model.key_ctrl[0, k] if model.nkey else rest)
    return low, min(max(rest, low), high), high


def element_senses(loaded: LoadedModel) -> dict[str, Sense]:
    """Return the channels that a model's elements can show, by the names of the contract."""
    model, senses = loaded.model, dict[str, Sense]()
    for k, name in enumerate(loaded.names("joint")):
        if model.jnt_type[k] in SCALAR_JOINTS:
            sliding = slides(model, "joint", k)
            senses |= {f"joint.{name}.{w}": Sense(g[sliding], k, unit=_PORT_UNITS[w][sliding]) for w, g in _JOINT_GROUPS.items()}
    for k, name in enumerate(loaded.names("actuator")):
        sliding = slides(model, "actuator", k)
        senses |= {f"actuator.{name}.{w}": Sense(g[sliding], k, unit=_PORT_UNITS[w][sliding]) for w, g in _ACTUATOR_GROUPS.items()}
    for k, name in enumerate(loaded.names("tendon")):
        senses[f"tendon.{name}.length"] = Sense("tendon length", k, unit="m")
        senses[f"tendon.{name}.velocity"] = Sense("tendon speed", k, unit="m/s")
        senses[f"tendon.{name}.tension"] = Sense("tendon tension", k, unit="N")
    for k, name in enumerate(loaded.names("site")):
        senses |= {f"site.{name}.{a}": Sense("marker", k, axis) for axis, a in enumerate("xyz")}
    for k, name in enumerate(loaded.names("sensor")):
        unit, first, dim = sensor_unit(model, k), int(model.sensor_adr[k]), int(model.sensor_dim[k])
        senses |= {f"sensor.{name}.{i + 1}": Sense(f"sensor [{unit}]", first + i, unit=unit) for i in range(dim)}
        if dim == 1:
            senses[f"sensor.{name}"] = Sense(f"sensor [{unit}]", first, unit=unit)
    return senses


@dataclass(frozen=True, kw_only=True)
class ModelBody(Body):
    """A compiled model and the names of its elements; effects change `model` in place.

    `joints` are those that turn or slide (hinges and slides), by their number in the model, for effects with a parameter for each.
    `tip` is the site at which `tip_payload` hangs, -1 for none. `longest_step` (s) bounds the steps of its simulation.
    """

    loaded: LoadedModel
    model: mujoco.MjModel
    joints: tuple[int, ...]
    tip: int
    longest_step: float

    @cached_property
    def size(self) -> Size:  # type: ignore[override]
        """Its reach, and the torque that gravity and its springs put on a joint over that, relative to the reference robot."""
        return model_size(self.loaded.model)

    def touching(self, q: np.ndarray) -> Mapping[tuple[str, str], int]:
        return touching_bodies(self.loaded, q)

    def add_joint_inertia(self, inertia: np.ndarray) -> None:
        for joint, more in zip(self.joints, inertia, strict=True):
            self.model.dof_armature[self.model.jnt_dofadr[joint]] += more

    def add_joint_springs(self, stiffness: np.ndarray, preload: np.ndarray) -> None:
        model = self.model
        for joint, more, push in zip(self.joints, stiffness, preload, strict=True):
            at, own = model.jnt_qposadr[joint], float(model.jnt_stiffness[joint])
            total = max(own + more, abs(push) / FARTHEST_REST)
            if total > 0.0:
                model.qpos_spring[at] = (own * model.qpos_spring[at] + (total - own) * model.qpos0[at] + push) / total
                model.jnt_stiffness[joint] = total

    def limit_joints(self, lower: np.ndarray, upper: np.ndarray) -> None:
        model = self.model
        for joint, low, high in zip(self.joints, lower, upper, strict=True):
            own = model.jnt_range[joint].copy() if model.jnt_limited[joint] else np.array([-np.inf, np.inf])
            new = np.array([max(own[0], low), min(own[1], high)])
            if (new != own).any() and (np.abs(new) < NO_STOP).any():
                model.jnt_limited[joint], model.jnt_range[joint] = 1, [new[0], max(new[1], new[0] + LEAST_TRAVEL)]
                model.jnt_solref[joint], model.jnt_solimp[joint] = HARD_STOP

    def scale_actuators(self, share: np.ndarray) -> None:
        self._scale_gains(share)
        self.model.actuator_forcerange[:] *= share[:, None]

    def _scale_gains(self, share: np.ndarray) -> None:
        muscle = self.model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_MUSCLE)
        for numbers in (self.model.actuator_gainprm, self.model.actuator_biasprm):
            numbers[~muscle, :3] *= share[~muscle, None]
            numbers[muscle, 2:4] *= share[muscle, None]  # its peak force, or the scale of that; the others are lengths

    def limit_actuators(self, most: np.ndarray) -> None:
        model = self.model
        for k, limit in enumerate(most):
            own = model.actuator_forcerange[k].copy() if model.actuator_forcelimited[k] else np.array([-np.inf, np.inf])
            new = np.clip(own, -limit, limit)
            if np.isfinite(new).all() and (new != own).any():
                model.actuator_forcelimited[k], model.actuator_forcerange[k] = 1, new

    def move_tendon_sites(self, out: np.ndarray) -> None:
        for further, shift in zip(out, outward(self.loaded).values(), strict=True):
            self.model.site_pos[:] += further * shift

    def stretch_lines(self, give: np.ndarray) -> None:
        model, stiff = self.model, 1.0 / (1.0 - self.model.actuator_biasprm[:, 1] * give)
        late = np.where(_without_dynamics(model), np.maximum(-stiff * give * model.actuator_biasprm[:, 2], 0.0), 0.0)
        self._scale_gains(stiff)
        model.actuator_biasprm[late > 0.0, 2] *= stiff[late > 0.0]
        model.actuator_dynprm[late > 0.0, LINE_LAG] = late[late > 0.0]


def line_lag(model: mujoco.MjModel) -> np.ndarray:
    """Return by how much (nu,) s a stretching line makes the force of each actuator late after its control."""
    return np.where(_without_dynamics(model), model.actuator_dynprm[:, LINE_LAG], 0.0)


def _without_dynamics(model: mujoco.MjModel) -> np.ndarray:
    return model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_NONE)


def model_size(model: mujoco.MjModel) -> Size:
    """Return a model's size: reach, and torque over reach, each over the reference robot's and rounded to two digits."""
    reach = np.zeros(model.nbody)
    for k in range(1, model.nbody):
        reach[k] = reach[model.body_parentid[k]] + float(np.linalg.norm(model.body_pos[k]))
    ends = [reach[b] + float(np.linalg.norm(p)) for b, p in zip(model.site_bodyid, model.site_pos, strict=True)]
    moving = [reach[k] + float(np.linalg.norm(model.body_ipos[k])) for k in range(1, model.nbody)]
    length = max([*ends, *moving, 1e-3])
    weight = float(np.linalg.norm(model.opt.gravity) or 9.81) * float(model.body_mass[1:][model.body_dofnum[1:] > 0].sum())
    springs = [float(k) * (SPRING_SWING if t == int(mujoco.mjtJoint.mjJNT_HINGE) else 0.1 * SPRING_SWING * length)
               for k, t in zip(model.jnt_stiffness, model.jnt_type, strict=True)]  # fmt: skip
    torque = 0.5 * weight * length + max(springs, default=0.0)
    length_ratio, force_ratio = (
        max(float(f"{x / one:.2g}"), 1e-6) for x, one in zip((length, torque / length), REFERENCE_SIZE, strict=True)
    )
    return Size(length_ratio, force_ratio)


def tip_site(loaded: LoadedModel, named: str | None) -> int:
    """Return the site at which a tip payload hangs: the named one, else one with "tip" in its name, else that on the body farthest
    along the tree that has one; -1 for a model without sites."""
    names = loaded.names("site")
    if named is not None:
        return names.index(named)
    model = loaded.model
    depth: Callable[[int], int] = lambda body: 0 if body == 0 else 1 + depth(int(model.body_parentid[body]))  # noqa: E731
    ranked = sorted(range(len(names)), key=lambda k: ("tip" in names[k].lower(), depth(int(model.site_bodyid[k])), k))
    return ranked[-1] if ranked else -1


def payload_places(loaded: LoadedModel) -> Mapping[str, tuple[int, np.ndarray]]:
    """Return the sites and bodies that a mass may hang at, as (body, place in its frame)."""
    model = loaded.model
    bodies = {name: (k, model.body_ipos[k].copy()) for k, name in enumerate(loaded.names("body")) if k}
    sites = {name: (int(model.site_bodyid[k]), model.site_pos[k].copy()) for k, name in enumerate(loaded.names("site"))}
    return {**bodies, **sites}
