"""Family "hand": silicone fingers evenly around a palm, parallel to its axis, each with its own tendons and cords.

Finger k of n is at the angle 2 pi (k - 1) / n. Its x axis, where its tendon 1 is, points to the palm's axis; its z axis is the
palm's.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from twin.body import Port, Sense
from twin.mechanics.silicone import HandBody, HandDynamics, HandStatics
from twin.mechanics.silicone.drawing import PALM_COLOUR, PALM_THICKNESS, HandFigure
from twin.mechanics.silicone.statics import rotation_about_z
from twin.robots.families import soft
from twin.robots.schemas.hand import HAND_SCHEMA as SCHEMA
from twin.robots.schemas.hand import Hand, finger_values

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> HandBody:
    """Build the hand from `structure` and `values` (SI, by parameter name) that SCHEMA allows."""
    shape = Hand.model_validate(dict(structure))
    one, n = shape.finger().model_dump(), shape.fingers
    numbers = tuple(finger_values(k, shape, values) for k in range(n))
    fingers = tuple(soft.build(one, own) for own in numbers)
    angle = 2.0 * np.pi * np.arange(n) / n
    places = values["palm.radius"] * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    turns = np.stack([rotation_about_z(a + np.pi) for a in angle])
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[values["palm.radius"], PALM_THICKNESS, 0], pos=[0, 0, -PALM_THICKNESS],
        rgba=[*(c / 255 for c in PALM_COLOUR), 1.0], contype=0, conaffinity=0,
    )  # fmt: skip
    for k, finger in enumerate(fingers):
        quat = [np.cos(0.5 * (angle[k] + np.pi)), 0.0, 0.0, np.sin(0.5 * (angle[k] + np.pi))]
        spec.attach(finger.spec, prefix=_prefix(k), frame=spec.worldbody.add_frame(pos=places[k], quat=quat))
    first = fingers[0]
    return HandBody(
        spec=spec,
        n_tendon=shape.tendons,
        features=first.features - {"skin"},  # a cloud shows all fingers at once
        ports=tuple(tuple(_port(k, port, n) for port in ports) for k, finger in enumerate(fingers) for ports in finger.ports),
        dynamic_drives=first.dynamic_drives,
        senses={
            _prefix(k) + name: _sense(k, sense, shape) for k, finger in enumerate(fingers) for name, sense in finger.senses.items()
        },
        tendon_sites=tuple(
            tuple(_prefix(k) + site for site in sites) for k, finger in enumerate(fingers) for sites in finger.tendon_sites
        ),
        marker_sites=tuple(_prefix(k) + site for k, finger in enumerate(fingers) for site in finger.marker_sites),
        fingers=fingers,
        numbers=numbers,
        places=places,
        turns=turns,
    )


def _prefix(k: int) -> str:
    return f"finger_{k + 1}_"


def _port(k: int, port: Port, n: int) -> Port:
    gains = np.zeros((n, len(port.tendon_gains)))
    gains[k] = port.tendon_gains
    return Port(_prefix(k) + port.channel, port.drive, tuple(gains.ravel()))


def _sense(k: int, sense: Sense, shape: Hand) -> Sense:
    one = shape.finger()
    count = {"tension": one.tendons, "displacement": one.tendons, "sensor": one.sensors, "marker": one.markers + 1}[sense.group]
    return Sense(sense.group, k * count + sense.index, sense.axis)


def hand(body: HandBody) -> HandBody:
    return body


statics, dynamics, figure = HandStatics, HandDynamics, HandFigure
chain = silicone = None
