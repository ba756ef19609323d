"""Family "mjcf": any robot that a MuJoCo model describes, driven by its actuators' controls and simulated by MuJoCo's steps."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import lru_cache

import mujoco
import numpy as np

from twin.body import Body, Drive, Port, Sense
from twin.mechanics.mjcf import (
    LONGEST_STEP,
    LoadedModel,
    ModelBody,
    ModelFigure,
    ModelSolver,
    control_span,
    control_unit,
    element_senses,
    geared,
    load_model,
    outward,
    payload_places,
    tip_site,
    winches_of,
)
from twin.robots.schemas.mjcf import MJCF_SCHEMA as SCHEMA
from twin.robots.schemas.mjcf import address_of, counts_of, joint_names, scalar_joints

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> ModelBody:
    """Return the model with these values (SI, by address) written into a copy of the compiled model."""
    return body_of(load_model(str(structure["model"])), structure, values)


def body_of(loaded: LoadedModel, structure: Mapping[str, object], values: Mapping[str, float]) -> ModelBody:
    """Return the body of a loaded model, as `build`."""
    model = copy(loaded.model)
    for name, value in values.items():
        address, component = address_of(loaded, name)
        numbers = address.of.read(model, address.element)
        numbers[component] = value
        address.of.write(model, address.element, numbers)
    known = _known(loaded, structure)
    return ModelBody(
        spec=loaded.spec.copy(),
        n_tendon=counts_of(loaded),
        features=known.features,
        ports=known.ports,
        senses=known.senses,
        dynamic_drives=frozenset({Drive.CONTROL}),
        tendon_sites=known.tendon_sites,
        marker_sites=loaded.names("site"),
        payload_places=known.places,
        loaded=loaded,
        model=model,
        joints=known.joints,
        tip=known.tip,
        longest_step=float(str(structure.get("timestep", LONGEST_STEP))),
    )


class _Known:
    """What a model's bodies have in common."""

    def __init__(self, loaded: LoadedModel, tip: str | None) -> None:
        model = loaded.model
        self.joints = scalar_joints(loaded)
        self.joint_names = joint_names(loaded)
        self.senses: Mapping[str, Sense] = element_senses(loaded)
        self.tip = tip_site(loaded, tip)
        self.places = frozenset(payload_places(loaded))
        self.ports = tuple(
            (
                Port(
                    f"actuator.{name}.ctrl",
                    Drive.CONTROL,
                    tuple(np.eye(model.nu)[k]),
                    control_unit(model, k),
                    control_span(model, k),
                ),
            )
            for k, name in enumerate(loaded.names("actuator"))
        )
        self.tendon_sites = tendon_sites(loaded)
        features = {
            "controls",
            "drive zeros",
            "start",
            "servos",
            "drives that saturate",
            "joints",
            "encoders",
            "drifting sensors",
            "friction of joints",
            "markers",
            "stops",
        }
        if np.linalg.norm(model.opt.gravity) > 0.0:
            features |= {"weight"}
        features |= {"load friction"} if geared(model)[list(self.joints)].any() else set()
        features |= ({"lines"} if winches_of(loaded) else set()) | ({"holes"} if outward(loaded) else set())
        self.features = frozenset(features)


def tendon_sites(loaded: LoadedModel) -> tuple[tuple[str, ...], ...]:
    """Return the sites that each spatial tendon passes, for drawing."""
    model, names = loaded.model, loaded.names("site")
    found = []
    for t in range(model.ntendon):
        wraps = range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t])
        found.append(tuple(names[model.wrap_objid[w]] for w in wraps if model.wrap_type[w] == int(mujoco.mjtWrap.mjWRAP_SITE)))
    return tuple(sites for sites in found if sites)


@lru_cache(maxsize=32)
def _shared(loaded: LoadedModel, tip: str | None) -> _Known:
    return _Known(loaded, tip)


def _known(loaded: LoadedModel, structure: Mapping[str, object]) -> _Known:
    tip = structure.get("tip")
    return _shared(loaded, str(tip) if tip is not None else None)


def statics(body: Body) -> ModelSolver:
    """Return the solver, which steps: a body of this family is predicted in motion always."""
    assert isinstance(body, ModelBody)
    return ModelSolver(body)


def figure(body: Body) -> ModelFigure:
    """Return its drawing: the model's geoms and tendons."""
    assert isinstance(body, ModelBody)
    return ModelFigure(body)


dynamics = None  # `statics` steps
chain = silicone = hand = None
