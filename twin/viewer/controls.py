"""The sliders of a robot by hand: pulls, loads, and a push."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from twin.body import Drive, Loads, Push
from twin.body.drawable import Drawable
from twin.body.hinge_chain import REFERENCE_SIZE
from twin.foundation.errors import DataError
from twin.prediction.kinematics import warmest_current
from twin.prediction.rollout import full_pull
from twin.prediction.twin import Twin
from twin.viewer.live import rest_command

SLIDER_RANGE = 1.5  # full pulls at the end of a slider
SLIDER_STEPS = 400  # of a control's slider
LARGEST_PUSH = 0.2  # N: bends the rod and the finger by centimetres
DRIVE_WORDS = {  # drive -> name, unit, hint, SI value of one unit
    Drive.TENSION: ("tension", "N", "tension that the load cell reads", 1.0),
    Drive.DISPLACEMENT: (
        "displacement",
        "mm",
        "length that motors on this side take up from the rest pose and those opposite let out; none is wound in alone, which jams",
        1e-3,
    ),
    Drive.CONTROL: ("control", "", "control of the model's actuator", 1.0),
    Drive.CURRENT: ("current", "A", "current through the SMA spring, which heats in tens of seconds and then pulls", 1.0),
}


class HandControls:
    """The controls in the panel's folder "by hand"."""

    def __init__(self, gui: viser.GuiApi, twin: Twin, figure: Drawable, changed: Callable[[Any], None]) -> None:
        """Call `changed` with every handle that a user may move. Raises DataError for a robot that no pull bends sideways."""
        self._twin, self._gravity, self._figure, self.warmest_spring = twin, twin.robot.gravity, figure, 0.0
        self.fingers, self.pushes = fingers(figure), twin.robot.build().pushes
        self.drives = _available_drives(twin)
        self.largest_tension: float | None = None
        if Drive.CONTROL in self.drives:
            self._add_control_sliders(gui, twin)
        else:
            self._add_pull_sliders(gui, twin)
        self._clock_panel(gui)
        self._add_load_sliders(gui)
        self._add_push_sliders(gui)
        handles = (
            *(s for of in self.sliders.values() for s in of), self.payload, self.tilt, self.azimuth, self.push,
            self.height, self.push_azimuth, self.push_lift, self.finger,
        )  # fmt: skip
        for handle in handles:
            changed(handle)

    def _add_pull_sliders(self, gui: viser.GuiApi, twin: Twin) -> None:
        full, first = full_pull(twin), self.drives[0]
        most = {
            Drive.TENSION: round(SLIDER_RANGE * full.tension, 1),
            Drive.DISPLACEMENT: round(SLIDER_RANGE * 1e3 * full.displacement, 1),
        }
        if Drive.CURRENT in self.drives:
            amperes, self.warmest_spring = warmest_current(twin)
            most[Drive.CURRENT] = round(amperes, 2)
        names = tuple(DRIVE_WORDS[d][0] for d in self.drives)
        self.drive_choice = gui.add_dropdown(
            "pull by", names, visible=len(names) > 1, hint="what the motors hold, or what heats the springs"
        )
        self._largest_bend, self._bends = most[Drive.DISPLACEMENT], _bends_by_finger(full.towards, self.fingers)
        self.sliders = {}
        for d in self.drives:
            bends = d is Drive.DISPLACEMENT
            signed = bends or (d is Drive.TENSION and self.pushes)
            (_, unit, hint, _), least = DRIVE_WORDS[d], -most[d] if signed else 0.0
            self.sliders[d] = [
                gui.add_slider(f"{part}, {unit}", least, most[d], 0.01, 0.0, hint=hint, visible=d is first)
                for part in (self._bend_names() if bends else self._tendon_names(_driven_part(d), twin.robot.n_tendon))
            ]
        self.largest_tension = most[Drive.TENSION]

    def _add_control_sliders(self, gui: viser.GuiApi, twin: Twin) -> None:
        """Add a slider for each actuator of an MJCF, over its range, else over what moves a robot of its size."""
        self.drive_choice = gui.add_dropdown("pull by", (DRIVE_WORDS[Drive.CONTROL][0],), visible=False)
        reach = self._figure.height
        force = REFERENCE_SIZE[1] * twin.robot.size.force
        usual = {"rad": 0.5 * np.pi, "m": 0.1 * reach, "N": force, "N*m": force * reach}
        sliders = []
        for port, *_ in twin.robot.build().ports:
            wide = usual.get(port.unit, 1.0)
            low, rest, high = port.span
            low, high = max(low, rest - wide) if np.isinf(low) else low, min(high, rest + wide) if np.isinf(high) else high
            label = port.channel.removeprefix("actuator.").removesuffix(".ctrl")
            step = float(f"{max(high - low, 1e-9) / SLIDER_STEPS:.0e}")
            hint = f"{DRIVE_WORDS[Drive.CONTROL][2]}, {port.unit}"
            sliders.append(gui.add_slider(f"{label}, {port.unit}", low, high, step, rest, hint=hint))
        self.sliders = {Drive.CONTROL: sliders}

    def _tendon_names(self, part: str, n: int) -> list[str]:
        """Return a name for each of n tendons, or springs, with its finger's where there are several."""
        each = n // self.fingers
        return [f"{finger_name(k // each, self.fingers)}{part} {k % each + 1}" for k in range(n)]

    def _bend_names(self) -> list[str]:
        """Return a name for each bend, with its finger's where there are several."""
        return [f"{finger_name(k, self.fingers)}bend {axis}" for k in range(self.fingers) for axis in "xy"]

    def _clock_panel(self, gui: viser.GuiApi) -> None:
        self.clock = gui.add_slider(
            "clock x", 0.0, 60.0, 1.0, 10.0, visible=False, hint="how much faster than real time the springs run; 0 stops the clock"
        )
        self.rest_button = gui.add_button("run until at rest", visible=False, hint="runs the clock until no spring warms or cools")
        self.release_button = gui.add_button("let go", hint="tendons slack or springs cold, history of friction cleared")

    def _add_load_sliders(self, gui: viser.GuiApi) -> None:
        backbone = not len(self._figure.faces)
        self.payload = gui.add_slider("payload, g", 0.0, 30.0, 1.0, 0.0, hint="a mass at the tip", visible=backbone)
        self.tilt = gui.add_slider("gravity tilt, deg", 0, 180, 5, 0, hint="angle from the described direction")
        self.azimuth = gui.add_slider("gravity azimuth, deg", 0, 355, 5, 0, hint="about the robot's axis")

    def _add_push_sliders(self, gui: viser.GuiApi) -> None:
        tall, able = max(round(1e3 * self._figure.height), 1), bool(len(self._figure.push_points))
        self.push = gui.add_slider(
            "push, N", 0.0, LARGEST_PUSH, 0.005, 0.0, hint="force at one point, drawn as an orange arrow", visible=able
        )
        self.height = gui.add_slider(
            "push at, mm",
            0,
            tall,
            1,
            tall,
            hint="distance from the base along the robot at rest; or click on the robot to push it there, inwards",
            visible=able,
        )
        about, lift = "direction about the robot's axis, 0 along x", "direction: 0 sideways, 90 from base to tip"
        self.push_azimuth = gui.add_slider("push azimuth, deg", 0, 355, 5, 0, hint=about, visible=able)
        self.push_lift = gui.add_slider("push lift, deg", -90, 90, 5, 0, hint=lift, visible=able)
        names = tuple(str(k) for k in range(1, self.fingers + 1))
        self.finger = gui.add_dropdown("pushed finger", names, visible=self.fingers > 1, hint="number around the palm, from x")

    def release(self) -> None:
        """Set all pulls to zero and show only the sliders of the chosen drive."""
        for drive, sliders in self.sliders.items():
            still = np.zeros(len(sliders)) if drive is Drive.DISPLACEMENT else rest_command(self._twin, drive)  # of bends: none
            for slider, rest in zip(sliders, still, strict=True):
                slider.value, slider.visible = float(rest), drive is self.drive
        self.clock.visible = self.rest_button.visible = self.drive is Drive.CURRENT

    @property
    def drive(self) -> Drive:
        """Return the chosen drive."""
        return next(d for d, (name, *_) in DRIVE_WORDS.items() if name == self.drive_choice.value)

    @property
    def pulls(self) -> list[viser.GuiSliderHandle]:
        """Return the sliders in use."""
        return self.sliders[self.drive]

    @property
    def command(self) -> np.ndarray:
        """Return the pulls that the sliders ask for, (n_tendon,) SI. A bend is no larger than a slider's end in any direction."""
        values, unit = np.array([p.value for p in self.pulls]), DRIVE_WORDS[self.drive][3]
        if self.drive is not Drive.DISPLACEMENT:
            return unit * values
        bends = values.reshape(-1, 2)
        size = np.linalg.norm(bends, axis=1, keepdims=True)
        return unit * self._bends @ (bends * np.minimum(1.0, self._largest_bend / np.maximum(size, 1e-12))).ravel()

    @property
    def force(self) -> np.ndarray:
        """Return the force of the push, (3,) N."""
        aside, lift = np.deg2rad(self.push_azimuth.value), np.deg2rad(self.push_lift.value)
        return self.push.value * np.array([np.cos(lift) * np.cos(aside), np.cos(lift) * np.sin(aside), np.sin(lift)])

    @property
    def applied_push(self) -> Push:
        """Return the push; on a skin it acts on the side from which it points inwards."""
        at = float(np.clip(1e-3 * self.height.value / self._figure.height, 0.0, 1.0))
        return Push(self.force, at, float(np.deg2rad(self.push_azimuth.value) + np.pi), int(self.finger.value) - 1)

    def pushed_point(self) -> int:
        """Return the index of the figure's hold nearest to the push."""
        push, holds = self.applied_push, self._figure.push_points
        away = np.abs(np.exp(1j * holds[:, 1]) - np.exp(1j * push.azimuth)) if len(self._figure.faces) else 0.0
        return int((np.abs(holds[:, 0] - push.height) + 0.3 * away + 10.0 * (holds[:, 2] != push.finger)).argmin())

    def push_at(self, hold: int) -> None:
        """Push at one of the figure's holds: into the skin; on a backbone in the direction set before."""
        height, azimuth, finger = self._figure.push_points[hold]
        self.height.value = round(1e3 * height * self._figure.height)
        if len(self._figure.faces):
            self.push_azimuth.value = int(5 * round(float(np.rad2deg(azimuth) + 180.0) % 360.0 / 5.0)) % 360
            self.finger.value = str(int(finger) + 1)
        if self.push.value == 0.0:
            self.push.value = 0.5 * LARGEST_PUSH

    @property
    def loads(self) -> Loads:
        tilt, azimuth, g = np.deg2rad(self.tilt.value), np.deg2rad(self.azimuth.value), self._gravity
        axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        along = g * np.cos(tilt) + np.cross(axis, g) * np.sin(tilt) + axis * (axis @ g) * (1.0 - np.cos(tilt))  # Rodrigues
        return Loads(along, 1e-3 * self.payload.value, push=self.applied_push if self.push.value else None)


def fingers(figure: Drawable) -> int:
    """Return how many fingers a figure has; a backbone is one."""
    return 1 + int(figure.push_points[:, 2].max(initial=0.0))


def finger_name(k: int, of: int) -> str:
    """Return how finger k (from 0) is named before a part of it, empty for the only one."""
    return f"finger {k + 1} " if of > 1 else ""


def _bends_by_finger(towards: np.ndarray, fingers: int) -> np.ndarray:
    """Return lengths (n_tendon, 2 fingers) by bends along x and y, for tendons that bend `towards` (n_tendon, 2).

    A tendon is taken up by the component of its own finger's bend towards it, and let out by that away from it.
    """
    n = len(towards)
    own = np.arange(n) // (n // fingers)
    lengths = np.zeros((n, fingers, 2))
    lengths[np.arange(n), own] = towards
    return lengths.reshape(n, 2 * fingers)


def _driven_part(drive: Drive) -> str:
    return "spring" if drive is Drive.CURRENT else "tendon"


def _available_drives(twin: Twin) -> list[Drive]:
    """Return the drives that every tendon of the robot has."""
    ports = twin.robot.build().ports
    ways = [d for d in DRIVE_WORDS if all(any(p.drive is d for p in port) for port in ports)]
    try:
        twin.heating(np.zeros(1))
    except DataError:  # no springs described
        ways = [d for d in ways if d is not Drive.CURRENT]
    return ways
