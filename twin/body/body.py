"""Interface of a robot's body: the channels that may drive it, the signals it shows, and the changes that effects make.

The mechanics (hinges, nodes, a drum) are hidden behind it. A family (`twin.robots.family`) builds bodies and their solvers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from twin.body.signals import Drive
from twin.foundation.errors import DataError
from twin.foundation.parameters import Size
from twin.measurements.channels import ANGLES

ROPE_FEATURES = frozenset({"rope"})  # of a body whose tendons may bed in and whose motors may stall


@dataclass(frozen=True)
class Port:
    """A channel that may drive a body.

    One SI unit of it gives each tendon `tendon_gains` (n_tendon,) SI: 1 for the tendon's own tension, m/rad for a drum's angle.
    """

    channel: str  # what it means, a name of the grammar of channels
    drive: Drive
    tendon_gains: tuple[float, ...]
    unit: str = ""  # SI, of a control, which may have one of several
    span: tuple[float, float, float] = (-np.inf, 0.0, np.inf)  # of a control: least, where it rests, most


@dataclass(frozen=True)
class Sense:
    """A channel that a body can show, as its place in `Signals.group(group)`; with `required_drive` only if its tendon has it."""

    group: str
    index: int
    axis: int = 0
    required_drive: Drive | None = None
    unit: str = ""  # SI, of a channel that may have one of several


@dataclass(frozen=True)
class Frame:
    """The markers' frame: reported = R(turn) x + shift, x in the base frame, turn a rotation vector (3,), shift (3,) m.

    Both are zero where the camera is registered to the base frame; a robot that never was has them as parameters.
    """

    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @staticmethod
    def from_values(values: Mapping[str, float]) -> Frame:
        """Build the frame from a robot's parameters frame.turn_x, ..., frame.shift_z; missing ones are zero."""
        turn, shift = (np.array([values.get(f"frame.{kind}_{a}", 0.0) for a in "xyz"]) for kind in ("turn", "shift"))
        return Frame(turn, shift)

    def to_marker_frame(self, points: np.ndarray) -> np.ndarray:
        """Transform points (..., 3) m from the base frame to the markers' frame."""
        if not (self.turn.any() or self.shift.any()):
            return points
        return points @ Rotation.from_rotvec(self.turn).as_matrix().T + self.shift


@dataclass(frozen=True, kw_only=True)
class Body:
    """A robot as an editable MuJoCo model.

    `ports` holds, for each drive, the channels it may be driven through; `dynamic_drives` are the drives that its dynamics accept.
    `senses` are the channels it can show. `load_channels` maps input channels that load it to fields of `Loads`. `antagonists` is
    as in `Signals`, `frame` is the markers' frame, `tendon_sites` are the sites each tendon passes, base to tip, `marker_sites`
    those of the markers, `imu_sites` those of the IMUs. `features` are what effects need to act on:

        weight, elasticity (one stiffness for all of it), markers, load cells, strain sensors, antagonists
        rope          tendons may bed in, motors may stall    planes       `set_bending_anisotropy` works
        slack         tendons only pull, and may be slack     rods         tendons push as well as pull
        length        `set_stiffness_gradient` works          rest shape   `set_rest_curvature` works
        holes         `move_tendon_holes` works, or, of an MJCF, `move_tendon_sites`
        lines         tendons may stretch                     surface      may touch obstacles
        viscosity     may creep                               skin         compared with clouds (`Problem.seen`)
        hanging zero  lengths count from where it hangs, not from a straight body
        friction of joints  a joint may rub                    load friction  a gear may rub with its load
        joints        inertia and stiffness of joints change  servos         strengths of actuators change
        encoders      joints' angles are read                 start          a trial may start from a pose, and settle
        stops         joints may end earlier
        controls      actuators' controls drive it      drive zeros    drives have a zero and a gain of their own

    `payload_places` are the sites and bodies that a declared mass may hang at.
    """

    spec: mujoco.MjSpec
    n_tendon: int
    features: frozenset[str]
    ports: tuple[tuple[Port, ...], ...]
    senses: Mapping[str, Sense]
    dynamic_drives: frozenset[Drive] = frozenset({Drive.TENSION})
    load_channels: Mapping[str, str] = field(default_factory=dict)
    antagonists: bool = False
    frame: Frame = field(default_factory=Frame)
    tendon_sites: tuple[tuple[str, ...], ...] = ()
    marker_sites: tuple[str, ...] = ()
    imu_sites: tuple[str, ...] = ()
    payload_places: frozenset[str] = frozenset()
    damping_time: float = 0.0  # s, damping over stiffness, where statics stands for motion

    @property
    def pushes(self) -> bool:
        """Whether its tendons are rods, which push as well as pull."""
        return "rods" in self.features

    def borne(self, tension: np.ndarray) -> np.ndarray:
        """Return of given tensions (N) what its tendons can bear: none below zero, unless they are rods."""
        return tension if self.pushes else np.maximum(tension, 0.0)

    def bending(self, pull: np.ndarray) -> np.ndarray:
        """Return tensions (N) for a bend of which each tendon has a part `pull`, below zero on the far side.

        Tendons on that side have none. Rods there push, so that all need but half.
        """
        return 0.5 * pull if self.pushes else np.maximum(pull, 0.0)

    def touching(self, q: np.ndarray) -> Mapping[tuple[str, str], int]:
        """Return which of its parts touch each other in shapes q (n, nq), each with the first row in which they do."""
        return {}

    @property
    def size(self) -> Size:
        """Its size relative to the reference robot, for which effects' numbers are written; 1 for a body without a rod."""
        return Size()

    def first_mode_frequency(self) -> float:
        """Return the frequency (Hz) of the first mode, a scale for rates; infinite for a body that only statics describes."""
        return math.inf

    def set_bending_anisotropy(self, along: float, across: float) -> None:
        """Change EI_x to EI_x (1 + along) and EI_y to EI_y (1 - along), with sqrt(EI_x EI_y) across coupling them.

        As the other changes: before the body is compiled. Raises DataError for a body that cannot be changed so.
        """
        raise self._unchangeable("bending planes")

    def set_stiffness_gradient(self, slope: float) -> None:
        """Multiply all stiffnesses by 1 + slope (s/L - 1/2), s the distance from the base."""
        raise self._unchangeable("stiffness along its length")

    def set_rest_curvature(self, about_x: float, about_y: float, slope: float) -> None:
        """Add a rest curvature (1/m) about x and y, times 1 + slope (s/L - 1/2)."""
        raise self._unchangeable("rest shape")

    def move_tendon_holes(self, tendon: int, angle: float, further: float) -> None:
        """Move all holes of a tendon (from 0) about the axis by `angle` (rad) and away from it by `further` (m)."""
        raise self._unchangeable("tendon holes")

    def add_joint_inertia(self, inertia: np.ndarray) -> None:
        """Add inertias (n_joint,) kg m^2 or kg to the joints."""
        raise self._unchangeable("joints")

    def limit_joints(self, lower: np.ndarray, upper: np.ndarray) -> None:
        """Keep the joints between stops (n_joint,) rad or m, hard ones, where these are nearer than their own."""
        raise self._unchangeable("joints")

    def add_joint_springs(self, stiffness: np.ndarray, preload: np.ndarray) -> None:
        """Add springs to the joints.

        Of `stiffness` (n_joint,) N m/rad or N/m, that push with `preload` (n_joint,) N m or N in the model's reference pose.
        """
        raise self._unchangeable("joints")

    def scale_actuators(self, share: np.ndarray) -> None:
        """Multiply what each actuator (n_actuator,) delivers, by its share."""
        raise self._unchangeable("actuators")

    def limit_actuators(self, most: np.ndarray) -> None:
        """Limit the force or torque of each actuator to `most` (n_drive,) N or N m, either way."""
        raise self._unchangeable("actuators")

    def move_tendon_sites(self, out: np.ndarray) -> None:
        """Move the sites of each tendon that crosses a hinge (n_crossing,) m away from the axis of the nearest such hinge."""
        raise self._unchangeable("tendon sites")

    def stretch_lines(self, give: np.ndarray) -> None:
        """Put springs that give by so much (n_actuator,), m/N in the actuator's own units, between winches and their tendons."""
        raise self._unchangeable("tendon lines")

    def _unchangeable(self, what: str) -> DataError:
        return DataError(f"a body of kind {type(self).__name__} has no {what} to change; remove the effect that changes it")


def tendon_ports(n: int, resistance: float = 1.0) -> tuple[tuple[Port, ...], ...]:
    """Return the ports of n tendons: tension, displacement, and current and voltage of an SMA spring of `resistance` (ohm)."""
    return tuple(
        (
            Port(f"tendon_{i}_tension", Drive.TENSION, tuple(gains)),
            Port(f"tendon_{i}_displacement", Drive.DISPLACEMENT, tuple(gains)),
            Port(f"sma_{i}_current", Drive.CURRENT, tuple(gains)),
            Port(f"sma_{i}_voltage", Drive.CURRENT, tuple(gains / resistance)),
        )
        for i, gains in enumerate(np.eye(n), 1)
    )


def tendon_senses(n: int) -> dict[str, Sense]:
    """Return the channels that n tendons and the SMA springs that pull them can show."""
    senses = {}
    for i in range(1, n + 1):
        senses |= {
            f"tendon_{i}_tension": Sense("tension", i - 1),
            f"tendon_{i}_displacement": Sense("displacement", i - 1),
            f"sma_{i}_temperature": Sense("temperature", i - 1, required_drive=Drive.CURRENT),
            f"sma_{i}_resistance": Sense("resistance", i - 1, required_drive=Drive.CURRENT),
        }
    return senses


def turn_senses(names: list[str], imus: int = 0) -> dict[str, Sense]:
    """Return the channels of the orientation of markers (or disks, or the tip), and of IMUs."""
    turns = {f"{name}_turn_{a}": Sense("turn", m, k) for m, name in enumerate(names) for k, a in enumerate("xyz")}
    single = {f"{name}_{a}": Sense("angles", m, k) for m, name in enumerate(names) for k, a in enumerate(ANGLES)}
    kinds = (("gyro", "imu rate"), ("accel", "imu force"))
    read = {f"imu_{i + 1}_{kind}_{a}": Sense(g, i, k) for i in range(imus) for kind, g in kinds for k, a in enumerate("xyz")}
    return turns | single | read


def marker_senses(names: list[str]) -> dict[str, Sense]:
    """Return the channels of markers (or disks, or the tip), given in the order of `Signals.markers`."""
    return {f"{name}_{a}": Sense("marker", m, k) for m, name in enumerate(names) for k, a in enumerate("xyz")}
