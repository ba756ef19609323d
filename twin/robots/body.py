"""What a family's builder returns: the MjSpec and the names an effect, a solver or a sensor needs to find its way in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class JointSet:
    """Three hinges at one point of the backbone: bending about two axes and twist. In a body that stretches also a slide.

    `arclength` is the point's fraction of the backbone's length (0 base, 1 tip), `length` the piece of backbone (m)
    whose bending the hinges carry.
    """

    bend_x: str
    bend_y: str
    twist: str
    arclength: float
    length: float
    slide: str | None = None


@dataclass(frozen=True)
class Frame:
    """Where the markers' frame is against the base frame: reported = R(turn) x + shift, turn a rotation vector (3,), shift (3,) m.

    A rig whose registration is known is in its base frame already; one that was never registered has these as parameters.
    """

    UNITS: ClassVar[Mapping[str, str]] = {
        **{f"frame.turn_{a}": "rad" for a in "xyz"}, **{f"frame.shift_{a}": "m" for a in "xyz"}
    }  # fmt: skip

    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @staticmethod
    def of(values: Mapping[str, float]) -> Frame:
        turn, shift = (np.array([values.get(f"frame.{kind}_{a}", 0.0) for a in "xyz"]) for kind in ("turn", "shift"))
        return Frame(turn, shift)

    def reported(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the base frame as the markers' frame has them."""
        if not (self.turn.any() or self.shift.any()):
            return points
        return points @ Rotation.from_rotvec(self.turn).as_matrix().T + self.shift


@dataclass(frozen=True)
class Body:
    """A robot as an editable MuJoCo model.

    `tendons[i]` lists the sites tendon i + 1 passes, base to tip; `markers` maps a channel prefix ("disk_3") to its site;
    `disks` lists the sites of the disk centres, base to tip; `tip` is where payload and tip force act. `bows`: tendons are straight
    between disks and the backbone bows away from them; else they run in channels of the body. `frame` is that of the markers.
    `stiffening`: of a body that stretches, from 0 (Hooke) to 1 (neo-Hookean). `pivots`: hinges between rigid parts. `parts`: what
    an effect may need to act on.
    """

    spec: mujoco.MjSpec
    joints: tuple[JointSet, ...]
    tendons: tuple[tuple[str, ...], ...]
    markers: dict[str, str]
    disks: tuple[str, ...]
    tip: str
    length: float
    bows: bool = True
    frame: Frame = field(default_factory=Frame)
    stiffening: float = 0.0
    pivots: tuple[str, ...] = ()
    parts: frozenset[str] = frozenset({"backbone", "markers", "load cells"})


@dataclass(frozen=True, kw_only=True)
class Jaw(Body):
    """A rigid jaw on one hinge, turned by a pair of antagonist tendons from a drum.

    Turning the drum by q (rad) pulls tendon 1 in by drum q (m) and pays tendon 2 out by as much; turning the jaw by a from its
    `rest` (rad) takes pulley (a - rest) of tendon 1 and gives as much of tendon 2; `pulley` (m) is negative where they cross.
    At rest both pull with `pretension` (N) and give way by `stretch` (m/N); on its way each turns by `wrap` (rad) over idlers.
    """

    drum: float
    pulley: float
    rest: float
    wrap: float
    pretension: float
    stretch: float


def hinge_pairs(body: Body) -> Iterator[tuple[str, str]]:
    """Hinges about the same axis in the two joint sets of each disk interval."""
    for one, other in zip(body.joints[::2], body.joints[1::2], strict=True):
        yield from ((one.bend_x, other.bend_x), (one.bend_y, other.bend_y), (one.twist, other.twist))
