"""A twin as an MJCF. That of an MJCF as a better one: its numbers and effects as attributes, its other laws as custom numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco

from twin.body import Bumpers, Loads, Route, Rubbing
from twin.body.hinge_chain import HingeChain
from twin.effects import Effect
from twin.foundation.atomic_write import write_all_atomically
from twin.foundation.errors import DataError
from twin.foundation.parameters import FittedValue
from twin.mechanics.mjcf import (
    ModelBody,
    ModelSolver,
    WrittenModel,
    check_same,
    exact_text,
    longest_step,
    name_element,
    with_comments,
    written_model,
)
from twin.prediction.mjcf.chain import export_chain
from twin.prediction.mjcf.chain_stepper import TWIN_FILE
from twin.prediction.mjcf.comments import Origins, element_comments, heading
from twin.prediction.mjcf.natives import write_friction
from twin.prediction.mjcf.stepper import PREFIX, numbers_of
from twin.prediction.provenance import run_provenance
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import twin_table, twin_text
from twin.robots import load_family

MODEL_FILE = "robot.xml"
_STEPPED = ("command", "drive", "route", "sense")  # places of effects that go along as laws
_LAWS = "laws that MuJoCo has not, for twin.prediction.mjcf.ModelStepper; what stands above in their place is said there"


def write_mjcf(twin: Twin, folder: Path, origins: Origins) -> Path:
    """Write `folder`/robot.xml and the files it needs, all or none; return the file. Raises DataError as `export_mjcf`."""
    made = export_mjcf(twin, origins)
    if not isinstance(twin.robot.build(), ModelBody):  # its laws do not stand in the model
        made = replace(made, files={**made.files, TWIN_FILE: _twin_file(twin, folder, origins)})
    try:
        for name in (MODEL_FILE, *made.files):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made ({error.strerror or error}); give a folder you may write to") from None
    files = {MODEL_FILE: made.text.encode(), **made.files}
    write_all_atomically({folder / name: content for name, content in files.items()}, "give a folder you may write to")
    return folder / MODEL_FILE


def export_mjcf(twin: Twin, origins: Origins) -> WrittenModel:
    """Return a twin as an MJCF of its own, with files it needs beside it; a rod as `export_chain` says.

    Parameters, and effects that change the body or its loads, are numbers of the model; a comment before each element says which,
    with standard error and the described number. Other effects are custom numbers, `twin.EFFECT.PARAMETER`, which `ModelStepper`
    steps; what MuJoCo has nearest to them (`twin.prediction.mjcf.natives`) stands in the model beside that. What is returned is
    compiled and compared with the twin's own model.

    Raises DataError for a robot that is neither MJCF nor rod, an effect that has no place in one, and a number that
    cannot be written.
    """
    body = twin.body()
    if isinstance(body, HingeChain) and load_family(twin.robot.family).dynamics is not None:
        return export_chain(twin, body, origins)
    if not isinstance(body, ModelBody):
        raise DataError(
            f"robot {twin.robot.name!r} is of family {twin.robot.family!r}; families 'mjcf' and 'continuum' are written as MJCF: "
            "roll this twin out with `twin rollout`, or step it in an environment of twin.env"
        )
    if lost := [e.id for e in twin.effects if not _has_place(e)]:
        raise DataError(f"effect {lost[0]} has no place in an MJCF; remove it from the twin")
    chain = twin.effect_chain
    wanted = ModelSolver(body).loaded_model(chain.surround(Loads(twin.robot.gravity)))
    spec, described = written_model(body.loaded, wanted)
    spec.option.timestep = longest_step(body, chain.route)
    comments = element_comments(twin, body, origins)
    for kind, name in comments:
        name_element(spec, body.loaded, kind, name)
    write_friction(spec, chain.route.rubbing)
    _write_effects(spec, twin.effects)
    compiled = spec.compile()
    made = WrittenModel(with_comments(exact_text(spec), heading(twin, body, origins), comments, _LAWS), described.files)
    check_same(made.compile(), compiled, body.loaded.path.name)
    return made


def _twin_file(twin: Twin, folder: Path, origins: Origins) -> bytes:
    """Return the twin as a file in `folder`."""
    units = {p.name: p.unit for p in twin.robot.parameters}
    numbers = {n: FittedValue(v, origins.std.get(n), units[n]) for n, v in twin.values.items()}
    effects = {
        e.id: {
            p.name: FittedValue(e[p.name], origins.std.get(f"{e.id}.{p.name}"), p.unit)
            for p in e.all_parameters(e.n_tendon)
            if p.name in e.values
        }
        for e in twin.effects
    }
    return twin_text(twin_table(twin, folder, numbers, effects), run_provenance("twin export", 0, "")).encode()


def _has_place(effect: Effect) -> bool:
    """Return whether an effect's law can be written or stepped."""
    route = replace(effect.route(), mu=0.0, presliding=Route().presliding, mu_shares=(), rubbing=Rubbing(), bumpers=Bumpers())
    return (
        not effect.acts_in("soften", "spring", "deform")
        and route == Route()
        and (not effect.acts_in("command", "drive") or effect.acts_in("by_step"))
    )


def _write_effects(spec: mujoco.MjSpec, effects: tuple[Effect, ...]) -> None:
    """Write the effects that act on signals and between steps."""
    for number in [n for n in spec.numerics if n.name.startswith(PREFIX)]:  # of an export that this robot was made from
        spec.delete(number)
    for effect in effects:
        if effect.acts_in(*_STEPPED) and not effect.write(spec):
            for name, value in numbers_of(effect).items():
                spec.add_numeric(name=name, size=1, data=[value])
