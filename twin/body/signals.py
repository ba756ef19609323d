"""The signals of one trial: commands of the drives and readings of the sensors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, PPoly


class Drive(StrEnum):
    """The drive of a tendon: by tension (N), by displacement at its motor (m), or by the current (A) of its SMA spring.

    An actuator of an MJCF is driven by its control, in the unit that its model gives it. Controls are known exactly, and their zero
    means nothing.
    """

    TENSION = "tension"
    DISPLACEMENT = "displacement"
    CURRENT = "current"
    CONTROL = "control"

    @property
    def display_unit(self) -> tuple[str, float]:
        """The unit shown to people, and its factor from SI."""
        return {"tension": ("N", 1.0), "displacement": ("mm", 1e3), "current": ("A", 1.0), "control": ("", 1.0)}[self]

    @property
    def typical_noise(self) -> float:
        """The typical noise of one reading (SI): 10 mN, 20 um, 3 mA; NaN of a control, whose scale is that of its range."""
        return {"tension": 0.01, "displacement": 2e-5, "current": 3e-3, "control": float("nan")}[self]


Drives = tuple[Drive, ...]  # one a tendon
POINTS_NDIM = 3  # of signals with x, y and z


def drive_mask(drives: Drives, kind: Drive) -> np.ndarray:
    """Return (n_tendon,) whether each tendon has this kind of drive."""
    return np.array([d is kind for d in drives], bool)


@dataclass(frozen=True)
class Signals:
    """The signals of one trial, true or reported; the first axis is the sample.

    As input (`Effect.command`, `Effect.drive`), a quantity that does not drive its tendon is zero.
    """

    time: np.ndarray  # (n,) s in the trial
    clock: np.ndarray  # (n,) s since the first trial
    tension: np.ndarray  # (n, n_tendon) N at the base
    displacement: np.ndarray  # (n, n_tendon) m at the motor
    markers: np.ndarray  # (n, n_marker, 3) m
    temperature: np.ndarray  # (n,) K, of the room
    drives: Drives = (Drive.TENSION,)
    current: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))  # (n, n_tendon) A, of the SMA springs
    antagonists: bool = False  # two tendons pretensioned against each other on a rigid joint
    others: Mapping[str, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))  # further groups, (n, n_port) SI
    smooth: bool = False  # commands between rows follow monotone cubics; else straight lines
    control: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))  # (n, n_tendon), of an MJCF's actuators

    @property
    def driven_by_length(self) -> np.ndarray:
        """(n_tendon,) whether displacement drives the tendon."""
        return drive_mask(self.drives, Drive.DISPLACEMENT)

    @property
    def driven_by_current(self) -> np.ndarray:
        """(n_tendon,) whether the current of an SMA spring drives the tendon."""
        return drive_mask(self.drives, Drive.CURRENT)

    @property
    def driven_by_control(self) -> np.ndarray:
        """(n_tendon,) whether the control of an MJCF's actuator drives it."""
        return drive_mask(self.drives, Drive.CONTROL)

    @property
    def command(self) -> np.ndarray:
        """(n, n_tendon) SI, the quantity that drives each tendon."""
        if self.driven_by_control.all():
            return self.control
        return np.where(self.driven_by_length, self.displacement, np.where(self.driven_by_current, self.current, self.tension))

    def with_commands(self, change: Callable[[np.ndarray], np.ndarray], **others: np.ndarray) -> Signals:
        """Return a copy whose tensions, displacements and controls, where these drive, are `change` of them; `others` replaced."""
        control = change(self.control) if self.driven_by_control.any() else self.control
        return replace(self, tension=change(self.tension), displacement=change(self.displacement), control=control, **others)

    def with_changes(self, **changes: Any) -> Signals:
        """Return a copy with some fields replaced."""
        return replace(self, **changes)

    def between_rows(self, longest: float) -> Signals:
        """Return the signals, straight between rows, with more rows: equal parts of each interval, the usual one in `longest` s."""
        rows = np.arange(len(self.time), dtype=float)
        parts = max(1, math.ceil(float(np.median(np.diff(self.time))) / longest - 1e-9))
        at = np.arange((len(rows) - 1) * parts + 1) / parts

        def straight(x: np.ndarray) -> np.ndarray:
            below = np.minimum(at.astype(int), len(rows) - 2)
            share = (at - below).reshape(-1, *(1,) * (x.ndim - 1))
            return x[below] + share * (x[below + 1] - x[below]) if len(x) == len(rows) else x

        arrays = ("time", "clock", "tension", "displacement", "markers", "temperature", "current", "control")
        return replace(self, **{name: straight(getattr(self, name)) for name in arrays}, others={})

    def group(self, name: str) -> np.ndarray:
        """Return a group by its name: "marker", "turn", "angles" and IMUs' (n, n_place, 3), others (n, n_port, 1)."""
        if name == "marker":
            return self.markers
        own = {"tension": self.tension, "displacement": self.displacement}
        found = (own | dict(self.others))[name]
        return found if found.ndim == POINTS_NDIM else found[..., None]


def interpolate_commands(signals: Signals, command: np.ndarray) -> PPoly:
    """Return commands (n, n_tendon) of a trial of two or more rows as a function of time."""
    if signals.smooth:
        return PchipInterpolator(signals.time, command)
    chords = np.diff(command, axis=0) / np.diff(signals.time)[:, None]
    return PPoly(np.stack([0.0 * chords, 0.0 * chords, chords, command[:-1]]), signals.time)
