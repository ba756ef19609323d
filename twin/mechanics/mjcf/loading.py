"""Loads an MJCF once, and says in one sentence why one cannot be used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco

from twin.foundation.errors import DataError, short_repr

SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
KINDS = {
    "body": mujoco.mjtObj.mjOBJ_BODY, "joint": mujoco.mjtObj.mjOBJ_JOINT, "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "site": mujoco.mjtObj.mjOBJ_SITE, "tendon": mujoco.mjtObj.mjOBJ_TENDON, "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR, "key": mujoco.mjtObj.mjOBJ_KEY,
}  # fmt: skip
_COUNTS = {
    "body": "nbody", "joint": "njnt", "actuator": "nu", "site": "nsite", "tendon": "ntendon", "geom": "ngeom", "sensor": "nsensor",
    "key": "nkey",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """A model as described: to be copied, never changed."""

    path: Path
    spec: mujoco.MjSpec
    model: mujoco.MjModel

    def names(self, kind: str) -> tuple[str, ...]:
        """Return the names of all elements of a kind, in the model's order; one without a name is called KIND_I, I from 1."""
        count = getattr(self.model, _COUNTS[kind])
        return tuple(mujoco.mj_id2name(self.model, KINDS[kind], k) or f"{kind}_{k + 1}" for k in range(count))


def load_model(path: str | Path) -> LoadedModel:
    """Return the MJCF at `path`, loaded. Raises DataError, in one sentence, for one that is missing, broken or not supported."""
    path = Path(path)
    try:
        stamp = path.stat().st_mtime_ns
    except OSError:
        raise DataError(f"model {short_repr(str(path), 300)}: no such file; name one beside robot.toml") from None
    return _load(path, stamp)


@lru_cache(maxsize=16)
def _load(path: Path, stamp: int) -> LoadedModel:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        raise DataError(f"model {short_repr(path.name)} does not load in MuJoCo {mujoco.__version__}: {said}; correct it") from None
    if why := why_unsupported(model):
        raise DataError(f"model {short_repr(path.name)} cannot be used: {why}")
    return LoadedModel(path, spec, model)


def why_unsupported(model: mujoco.MjModel) -> str:
    """Return what of a model stands in the way, with the way out; empty if nothing does."""
    if model.nu == 0:
        return "it has no actuator, so that no command drives it; add an <actuator>"
    if (model.actuator_ctrlnum != 1).any() or (model.actuator_outnum != 1).any():
        k = int(((model.actuator_ctrlnum != 1) | (model.actuator_outnum != 1)).argmax())
        return f"actuator {model.actuator(k).name!r} has not one control and one force; leave it out"
    if model.nplugin:
        return "it has plugins, which are not simulated here; leave them out"
    if model.nflex:
        return "it has deformable bodies (flex), which are not simulated here; leave them out"
    free = [
        model.joint(j).name or f"joint_{j + 1}" for j in range(model.njnt) if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_FREE)
    ]
    if free and model.nkey == 0:
        return f"joint {free[0]!r} leaves a body free and no keyframe says where it starts; add a <keyframe>, or fix the body"
    if model.njnt == 0:
        return "it has no joint, so that nothing moves; add one"
    return ""
