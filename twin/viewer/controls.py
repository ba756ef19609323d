"""The sliders of a robot by hand: what pulls it, what loads it, where it is pushed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from twin.effects import Drive, Loads, Push
from twin.errors import DataError
from twin.figure import Figure
from twin.kinematics import warmest_current
from twin.rollout import full_pull
from twin.twin import Twin

MOST = 1.5  # full pulls at a slider's end
MOST_PUSH = 0.2  # N: bends the rod and the finger by centimetres
BY = {  # what is pulled by: name, unit, meaning, SI of one
    Drive.TENSION: ("tension", "N", "tension as its load cell reads it", 1.0),
    Drive.DISPLACEMENT: (
        "displacement",
        "mm",
        "taken up by its motor from the hanging rest, negative let out; the others hold",
        1e-3,
    ),
    Drive.CURRENT: ("current", "A", "through its SMA spring, which it heats in tens of seconds; the spring then pulls", 1.0),
}


class Controls:
    """What stands in the panel's folder "by hand"."""

    def __init__(self, gui: viser.GuiApi, twin: Twin, figure: Figure, changed: Callable[[Any], None]) -> None:
        """`changed` is told of every handle that a person may move. Raises DataError for a robot that no pull bends sideways."""
        self._gravity, self._figure, self.warmest = twin.robot.gravity, figure, 0.0
        self.ways = _ways(twin)
        self._pulls(gui, twin)
        self._clock_panel(gui)
        self._loads(gui)
        self._push(gui)
        handles = (
            *(s for of in self.sliders.values() for s in of), self.payload, self.tilt, self.azimuth, self.push,
            self.height, self.aside, self.lift, self.finger,
        )  # fmt: skip
        for handle in handles:
            changed(handle)

    def _pulls(self, gui: viser.GuiApi, twin: Twin) -> None:
        full, first = full_pull(twin), self.ways[0]
        most = {Drive.TENSION: round(MOST * full.tension, 1), Drive.DISPLACEMENT: round(MOST * 1e3 * full.displacement, 1)}
        if Drive.CURRENT in self.ways:
            amperes, self.warmest = warmest_current(twin)
            most[Drive.CURRENT] = round(amperes, 2)
        # One motor can take up only what others let out.
        least = {d: -most[d] if d is Drive.DISPLACEMENT else 0.0 for d in most}
        names = tuple(BY[d][0] for d in self.ways)
        self.by = gui.add_dropdown("pull by", names, visible=len(names) > 1, hint="what motors hold, or what heats the springs")
        self.sliders = {
            d: [
                gui.add_slider(f"{_pulled(d)} {i}, {BY[d][1]}", least[d], most[d], 0.01, 0.0, hint=BY[d][2], visible=d is first)
                for i in range(1, twin.robot.n_tendon + 1)
            ]
            for d in self.ways
        }
        self.most = most[Drive.TENSION]

    def _clock_panel(self, gui: viser.GuiApi) -> None:
        self.clock = gui.add_slider(
            "clock x", 0.0, 60.0, 1.0, 10.0, visible=False, hint="seconds of the springs in one of yours; 0 stops the clock"
        )
        self.rest = gui.add_button("on until at rest", visible=False, hint="the clock goes on until no spring warms or cools")
        self.slack = gui.add_button("let go", hint="tendons slack or springs cold, friction's history forgotten")

    def _loads(self, gui: viser.GuiApi) -> None:
        backbone = not len(self._figure.faces)
        self.payload = gui.add_slider("payload, g", 0.0, 30.0, 1.0, 0.0, hint="a mass at the tip", visible=backbone)
        self.tilt = gui.add_slider("gravity tilt, deg", 0, 180, 5, 0, hint="of its direction from that described")
        self.azimuth = gui.add_slider("gravity azimuth, deg", 0, 355, 5, 0, hint="about the robot's axis")

    def _push(self, gui: viser.GuiApi) -> None:
        tall, fingers = round(1e3 * self._figure.height), 1 + int(self._figure.holds[:, 2].max())
        self.push = gui.add_slider("push, N", 0.0, MOST_PUSH, 0.005, 0.0, hint="a force at one point, the orange arrow")
        self.height = gui.add_slider(
            "push at, mm", 0, tall, 1, tall, hint="from the base along the robot at rest; or click on the robot: there, and inwards"
        )
        self.aside = gui.add_slider("push azimuth, deg", 0, 355, 5, 0, hint="where it points about the robot's axis, 0 along x")
        self.lift = gui.add_slider("push lift, deg", -90, 90, 5, 0, hint="where it points: 0 sideways, 90 from base to tip")
        names = tuple(str(k) for k in range(1, fingers + 1))
        self.finger = gui.add_dropdown("pushed finger", names, visible=fingers > 1, hint="by number around the palm, from x")

    def let_go(self) -> None:
        """All pulls to zero; only the sliders of what pulls now are shown."""
        for drive, sliders in self.sliders.items():
            for slider in sliders:
                slider.value, slider.visible = 0.0, drive is self.drive
        self.clock.visible = self.rest.visible = self.drive is Drive.CURRENT

    @property
    def drive(self) -> Drive:
        """What the sliders are."""
        return next(d for d, (name, *_) in BY.items() if name == self.by.value)

    @property
    def pulls(self) -> list[viser.GuiSliderHandle]:
        """The sliders in use."""
        return self.sliders[self.drive]

    @property
    def command(self) -> np.ndarray:
        """(n_tendon,) SI, what the sliders say."""
        return np.array([p.value for p in self.pulls]) * BY[self.drive][3]

    @property
    def force(self) -> np.ndarray:
        """(3,) N, of the push."""
        aside, lift = np.deg2rad(self.aside.value), np.deg2rad(self.lift.value)
        return self.push.value * np.array([np.cos(lift) * np.cos(aside), np.cos(lift) * np.sin(aside), np.sin(lift)])

    @property
    def held(self) -> Push:
        """The push as it stands: on a skin, on the side from which it points inwards."""
        at = float(np.clip(1e-3 * self.height.value / self._figure.height, 0.0, 1.0))
        return Push(self.force, at, float(np.deg2rad(self.aside.value) + np.pi), int(self.finger.value) - 1)

    def point(self) -> int:
        """Which of the figure's holds is nearest to the push."""
        push, holds = self.held, self._figure.holds
        away = np.abs(np.exp(1j * holds[:, 1]) - np.exp(1j * push.azimuth)) if len(self._figure.faces) else 0.0
        return int((np.abs(holds[:, 0] - push.height) + 0.3 * away + 10.0 * (holds[:, 2] != push.finger)).argmin())

    def take(self, hold: int) -> None:
        """Push at one of the figure's holds: into the skin, or on a backbone as before."""
        height, azimuth, finger = self._figure.holds[hold]
        self.height.value = round(1e3 * height * self._figure.height)
        if len(self._figure.faces):
            self.aside.value = int(5 * round(float(np.rad2deg(azimuth) + 180.0) % 360.0 / 5.0)) % 360
            self.finger.value = str(int(finger) + 1)
        if self.push.value == 0.0:
            self.push.value = 0.5 * MOST_PUSH

    @property
    def loads(self) -> Loads:
        tilt, azimuth, g = np.deg2rad(self.tilt.value), np.deg2rad(self.azimuth.value), self._gravity
        axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        along = g * np.cos(tilt) + np.cross(axis, g) * np.sin(tilt) + axis * (axis @ g) * (1.0 - np.cos(tilt))  # Rodrigues
        return Loads(along, 1e-3 * self.payload.value, push=self.held if self.push.value else None)


def _pulled(drive: Drive) -> str:
    return "spring" if drive is Drive.CURRENT else "tendon"


def _ways(twin: Twin) -> list[Drive]:
    """What may drive every tendon of the robot."""
    ports = twin.robot.build().drives
    ways = [d for d in BY if all(any(p.drive is d for p in port) for port in ports)]
    try:
        twin.heating(np.zeros(1))
    except DataError:  # no springs described
        ways = [d for d in ways if d is not Drive.CURRENT]
    return ways
