"""Family "mjcf": any robot that a MuJoCo model describes, driven by its actuators' controls and simulated by MuJoCo's steps."""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import copy
from functools import lru_cache

import mujoco
import numpy as np

from twin.body import Body, Counts, Drive, Port, Sense
from twin.mechanics.mjcf import (
    LONGEST_STEP,
    LoadedModel,
    ModelBody,
    ModelSolver,
    element_senses,
    load_model,
    payload_places,
    tip_site,
)
from twin.robots.schemas.mjcf import MJCF_SCHEMA as SCHEMA
from twin.robots.schemas.mjcf import Address, addresses, joint_names, scalar_joints

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]

_COMPONENT = re.compile(r"_([123])$")


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> ModelBody:
    """Return the model with these values (SI, by address) written into a copy of the compiled model."""
    loaded = load_model(str(structure["model"]))
    model = copy(loaded.model)
    for name, value in values.items():
        address, component = _address(loaded, name)
        numbers = address.of.read(model, address.element)
        numbers[component] = value
        address.of.write(model, address.element, numbers)
    known = _known(loaded, structure)
    return ModelBody(
        spec=loaded.spec.copy(),
        n_tendon=Counts.of(model.nu, known.joint_names, loaded.names("tendon")),
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


@lru_cache(maxsize=4096)
def _address(loaded: LoadedModel, name: str) -> tuple[Address, int]:
    """Return the number that a parameter is, and its component (from 0)."""
    found = _COMPONENT.search(name)
    if found is not None:
        plain = name[: found.start()]
        attribute = plain.rpartition(".")[2]
        if attribute in ("pos", "ipos", "range", "springlength", "forcerange"):
            return addresses(loaded, plain)[0], int(found[1]) - 1
    return addresses(loaded, name)[0], 0


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
            (Port(f"actuator.{name}.ctrl", Drive.CONTROL, tuple(np.eye(model.nu)[k])),)
            for k, name in enumerate(loaded.names("actuator"))
        )
        self.tendon_sites = tendon_sites(loaded)
        features = {
            "controls",
            "drive zeros",
            "start",
            "servos",
            "joints",
            "encoders",
            "friction of joints",
            "load friction",
            "markers",
        }
        if np.linalg.norm(model.opt.gravity) > 0.0:
            features |= {"weight"}
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


dynamics = None  # `statics` steps
figure = chain = silicone = hand = None
