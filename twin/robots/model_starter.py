"""The files of a robot that begins as a user's own MJCF: which of its numbers are taken to be uncertain, by how much, and why."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from twin.body import Drive, Loads, Problem
from twin.body.hinge_chain import REFERENCE_SIZE
from twin.foundation.atomic_write import write_all_atomically
from twin.measurements.parsing.toml_text import toml_lines, toml_value
from twin.mechanics.mjcf import (
    LONGEST_STEP,
    LoadedModel,
    ModelSolver,
    control_span,
    copied,
    load_model,
    model_size,
    tip_site,
)  # fmt: skip
from twin.robots.families.mjcf import body_of, tendon_sites
from twin.robots.schema import BOUND_STDS
from twin.robots.schemas.mjcf import LEAST_SHARE, MJCF_SCHEMA, Address, addresses, joint_names, usual_classes

ACCURACY_SHARE = 1e-3  # of a model's reach: what a drawing and its print are good for
GUIDE_STD = 0.2  # mm, by which a printed guide of a tendon is usually off its drawing
REST_SECONDS = 0.5  # that a model is held at rest to see whether steps are short enough, after it settled
MOST_NAMED = 6  # elements of a kind that a comment names


def copy_model(path: Path, folder: Path) -> LoadedModel:
    """Copy an MJCF and the files it needs into a folder, and return the copy. Raises DataError for one that cannot be used."""
    described = load_model(path)
    spec = described.spec.copy()
    spec.compile()
    copy = copied(spec, path)
    for name in copy.files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_all_atomically(
        {folder / path.name: copy.text.encode(), **{folder / name: content for name, content in copy.files.items()}}
    )
    return load_model(folder / path.name)


def model_text(name: str, file: str, loaded: LoadedModel, robot_format: str) -> str:
    """Return a commented robot.toml of the model called `file` beside it."""
    reach = model_size(loaded.model).length * REFERENCE_SIZE[0]
    accuracy = {
        "value": float(f"{min(ACCURACY_SHARE * reach, MJCF_SCHEMA.accuracy.high) * 1e3:.2g}"),
        "unit": "mm",
        "source": f"assumed: {ACCURACY_SHARE:.1%} of the model's reach",
    }
    head = [
        f"# {name}: the model beside this file, and below in which of its numbers a built robot may differ.",
        "#",
        *(f"#  {line}".rstrip() for line in MJCF_SCHEMA.diagram.splitlines()),
        *toml_lines({"format": robot_format, "family": "mjcf", "title": f"{name}, described by its MJCF"}),
        "",
        "[structure]",
        *toml_lines({"model": file}),
        *_structure(loaded),
        "",
        *_channels(loaded),
        "",
        *_parameters(loaded),
        *_exact(loaded),
        f"[accuracy]  # {MJCF_SCHEMA.accuracy.meaning}",
        *toml_lines(accuracy),
    ]
    return "\n".join(head) + "\n"


def assumed_widths(loaded: LoadedModel) -> str:
    """Return in one sentence which widths a new robot.toml takes for granted."""
    said = [
        f"{attribute} of {_plural(kind, len(uncertain))} {uncertain[0].of.relative_std:.0%}"
        for (kind, attribute), (uncertain, _) in usual_classes(loaded).items()
        if uncertain
    ]
    return f"assumed widths, as is usual of their kind: {', '.join(said) or 'none'}; robot.toml says why, and you may know better"


def _structure(loaded: LoadedModel) -> list[str]:
    sites, keys, tip = loaded.names("site"), loaded.names("key"), tip_site(loaded, None)
    lines = []
    if sites:
        lines.append(f"# {toml_lines({'tip': sites[tip]})[0]}  # site that a tip payload hangs at; left out: this one")
    if (own := float(loaded.model.opt.timestep)) < LONGEST_STEP and not _stands(loaded, LONGEST_STEP):
        lines.append(f"timestep = {own}  # s, the model's own: in steps of {1e3 * LONGEST_STEP:g} ms it diverges at rest")
    else:
        lines.append(f"# timestep = {LONGEST_STEP}  # s, longest step of a simulation")
    if keys:
        lines.append(f'# Trials start at keyframe {keys[0]}; another by start_pose = "NAME" in a [[trial]]: {_listed(keys)}')
    else:
        lines.append("# Trials start settled under their first command (settle = 2 s), from where springs and servos rest.")
    return lines


def _stands(loaded: LoadedModel, step: float) -> bool:
    """Return whether a model at rest stays finite in steps of this length (s)."""
    rest = [control_span(loaded.model, k)[1] for k in range(loaded.model.nu)]
    body = body_of(loaded, {"timestep": step}, {})
    time, loads = np.arange(0.0, REST_SECONDS, step), Loads(np.array(loaded.model.opt.gravity, float))
    held = Problem(time, np.tile(rest, (len(time), 1)), loads, drives=(Drive.CONTROL,) * loaded.model.nu)
    return not ModelSolver(body).solve(held).end_reason


def _channels(loaded: LoadedModel) -> list[str]:
    """Return comments on the channels that a log may have."""
    lines = ["# Channels of a log: a column's name, or its `quantity`. Inputs, all of them, exact:"]
    lines.append(f"#   actuator.NAME.ctrl of {_listed(loaded.names('actuator'))}")
    lines.append("# Outputs, those that you have:")
    many = {
        "joint.NAME.position|velocity|torque": joint_names(loaded), "tendon.NAME.length|velocity|tension": loaded.names("tendon"),
        "actuator.NAME.position|velocity|force": loaded.names("actuator"), "site.NAME.x|y|z": loaded.names("site"),
        "sensor.NAME, or sensor.NAME.K": loaded.names("sensor"),
    }  # fmt: skip
    return lines + [f"#   {pattern} of {_listed(names)}" for pattern, names in many.items() if names]


def _parameters(loaded: LoadedModel) -> list[str]:
    lines = [
        "[parameters]  # KIND.NAME.ATTRIBUTE, an exact name before a wildcard; without `value` it is the model's own",
        "# The widths are assumed, by kind of number. Better: what you weighed, measured or read, with its source.",
        f"# A fit keeps {BOUND_STDS:g} standard deviations to either side, and what is never negative above {LEAST_SHARE:g} of it,",
        "# unless `low` and `high` (with `unit`) are given.",
    ]
    for (kind, attribute), (uncertain, _) in usual_classes(loaded).items():
        if not uncertain:
            continue
        of = uncertain[0].of
        lines.append(f"# {attribute} of {_plural(kind, len(uncertain))}: +-{of.relative_std:.0%}")
        entry = toml_value({"relative_std": of.relative_std, "source": f"assumed: {of.why}"})
        lines += [f"{toml_value(key)} = {entry}" for key in _keys(loaded, kind, attribute, uncertain)]
    return lines


def _keys(loaded: LoadedModel, kind: str, attribute: str, uncertain: Sequence[Address]) -> list[str]:
    """Return one wildcard where it means just these numbers, else the address of each."""
    wildcard = f"{kind}.*.{attribute}"
    if len(uncertain) > 1 and addresses(loaded, wildcard) == list(uncertain):
        return [wildcard]
    return [a.key for a in uncertain]


def _exact(loaded: LoadedModel) -> list[str]:
    """Return comments on what is exact as the file stands, and often is not."""
    lines = ["#", "# Exact as this file stands; a `std` with its unit makes one uncertain:"]
    zero = {f"{kind} {what}": alike for (kind, what), (_, alike) in usual_classes(loaded).items() if alike and kind == "joint"}
    for what, alike in zero.items():
        lines.append(f"#   {what} is 0 of {_listed([a.name for a in alike])}")
    if any("frictionloss" in what or "damping" in what for what in zero):
        lines.append("#   (friction that the model lacks is looked for as an effect, joint_friction)")
    guides = list(dict.fromkeys(site for sites in tendon_sites(loaded) for site in sites))
    if guides:
        lines.append(f"#   where tendons are led, by {_listed(guides)}:")
        entry = toml_value({"std": [GUIDE_STD] * 3, "unit": "mm", "source": "printed to some tenths"})
        lines.append(f"# {toml_value(f'site.{guides[0]}.pos')} = {entry}")
    return [*lines, ""]


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _plural(kind: str, n: int) -> str:
    return kind if n == 1 else "bodies" if kind == "body" else f"{kind}s"
