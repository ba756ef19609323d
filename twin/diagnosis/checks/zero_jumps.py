"""Zeros that jump: a joint angle with a new zero, or a moved camera, from some row of the session on.

No effect of the robot but a nuisance of the recording: it is fitted beside everything else, never sought as an effect, and no part
of the diagnosed twin.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np
from scipy.spatial.transform import Rotation

from twin.body import Signals
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import Free, Model
from twin.diagnosis.thresholds import ROWS_FOR_ZERO, SIGNIFICANT_STANDARD_ERRORS
from twin.effects import Effect
from twin.foundation.parameters import Parameter
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin

TURN, SHIFT = ("turn_x", "turn_y", "turn_z"), ("shift_x", "shift_y", "shift_z")
ANGLE = "angle"


@dataclass(frozen=True)
class Jump:
    """One jump of a group of outputs.

    The last row before it and the first row after it (clock, s); for angles the joints' indices.
    """

    group: str
    last: float
    since: float
    joints: tuple[int, ...] = ()

    @property
    def numbers(self) -> tuple[str, ...]:
        return tuple(f"angle_{j + 1}" for j in self.joints) or (*TURN, *SHIFT)

    def parameters(self, n: int) -> tuple[Parameter, ...]:
        """Return the parameters of the n-th jump (from 1)."""
        known = {
            "angle": Parameter("", 0.0, "rad", -np.pi, np.pi, "an encoder counts from its start", std=0.2, scale=0.01),
            "turn": Parameter("", 0.0, "rad", -0.5, 0.5, "a camera knocked or set up again", std=0.05, scale=0.01),
            "shift": Parameter("", 0.0, "m", -0.1, 0.1, "a camera knocked or set up again", std=0.01, scale=1e-3),
        }
        return tuple(replace(known[x.partition("_")[0]], name=f"{x}_{n}") for x in self.numbers)


class Zeros(Effect):
    """From `since_n` on, angle_i + angle_i_n; marker = R(turn_n) x + shift_n, one jump after the other."""

    id = "zeros"
    jumps: ClassVar[tuple[Jump, ...]] = ()

    def sense(self, true: Signals) -> Signals:
        markers, angles = true.markers, true.others.get(ANGLE)
        for n, jump in enumerate(self.jumps, 1):
            after = true.clock >= jump.since
            by = np.array([self[f"{x}_{n}"] for x in jump.numbers])
            if jump.joints and angles is not None:
                angles = angles + np.outer(after, np.eye(angles.shape[1])[list(jump.joints)].T @ by)
            elif not jump.joints and after.any():
                moved = markers @ Rotation.from_rotvec(by[:3]).as_matrix().T + by[3:]
                markers = np.where(after[:, None, None], moved, markers)
        return true.with_changes(markers=markers, others=true.others if angles is None else {**true.others, ANGLE: angles})


def with_zero_jumps(model: Model, jumps: Sequence[Jump]) -> Model:
    """Return a calibrated model with these jumps, their sizes free."""
    parameters = tuple(p for n, jump in enumerate(jumps, 1) for p in jump.parameters(n))
    law = cast("type[Zeros]", type("Zeros", (Zeros,), {"jumps": tuple(jumps), "parameters": parameters}))
    return Model(replace(model.twin, effects=(*model.twin.effects, law())), (*model.free, *(Free(Zeros.id, p) for p in parameters)))


def jumps_of(twin: Twin) -> tuple[Jump, ...]:
    return next((e.jumps for e in twin.effects if isinstance(e, Zeros)), ())


def without(law: Zeros, jump: Jump) -> Zeros:
    """Return the zeros without one jump."""
    n = law.jumps.index(jump) + 1
    return type(law)({**law.values, **{f"{x}_{n}": 0.0 for x in jump.numbers}})


def of_robot(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return the effects without those that belong to one recording only."""
    return tuple(e for e in effects if not isinstance(e, Zeros))


def without_zero_jumps(twin: Twin) -> Twin:
    """Return the twin without what belongs to one recording only."""
    return replace(twin, effects=of_robot(twin.effects))


def words(prepared: PreparedRecording, fit: Fit) -> list[str]:
    """Return every jump with its fitted size, as a notice."""
    found, label = fit.fitted(Zeros.id), {t.name: t.label for t in prepared.recording.trials}
    clock = prepared.inputs[0].clock[0]
    out = []
    for n, jump in enumerate(jumps_of(fit.model.twin), 1):
        at = [found[f"{x}_{n}"].value or 0.0 for x in jump.numbers]
        before, after = (next(i for i in prepared.inputs if i.clock[0] <= t <= i.clock[-1]) for t in (jump.last, jump.since))
        if jump.joints:
            sure = [
                abs(a) > SIGNIFICANT_STANDARD_ERRORS * (found[f"{x}_{n}"].std or 0.0) for a, x in zip(at, jump.numbers, strict=True)
            ]
            sizes = [f"joint_{j + 1}_angle by {np.rad2deg(a):.2f} deg" for j, a in zip(jump.joints, at, strict=True)]
            what = f"the zero jumped: {', '.join(s for s, yes in zip(sizes, sure, strict=True) if yes) or ', '.join(sizes)}"
        else:
            turn, shift = np.rad2deg(np.linalg.norm(at[:3])), 1e3 * np.linalg.norm(at[3:])
            alone = len({o.index for o in prepared.outputs if OUTPUT_GROUPS[o.group].is_point}) == 1
            who = "the camera, or the robot in its clamp: one point cannot show which" if alone else "the camera, not the robot"
            what = f"the markers' frame moved by {shift:.1f} mm and {turn:.1f} deg ({who})"
        if before is after:
            where = f"within {label[before.name]}, {jump.since - before.clock[0]:.1f} s from its start"
        else:
            where = f"between {label[before.name]} and {label[after.name]}"
        minutes = (jump.since - clock) / 60.0
        out.append(f"{what}, {where}, {minutes:.0f} min into the session: fitted as a nuisance from there on, not as an effect")
        lost = [label[i.name] for i in prepared.inputs if jump.last < i.clock[0] and i.clock[-1] < jump.since]
        if lost:
            out.append(f"{', '.join(lost)}: run between these two rows, so that its zero is not known; the old one is used")
    return out


def rezeroed(prepared: PreparedRecording, group: str, raw: np.ndarray) -> np.ndarray:
    """Return the residuals (n, n_output) of a trial less the mean of its first `ROWS_FOR_ZERO` rows.

    Each angle has its own mean; points share one shift.
    """
    out = raw.copy()
    alike: dict[int, list[int]] = {}
    for c, o in enumerate(prepared.outputs):
        if o.group == group:
            alike.setdefault(o.axis if OUTPUT_GROUPS[group].is_point else o.index, []).append(c)
    for columns in alike.values():
        begun = raw[:ROWS_FOR_ZERO, columns]
        if np.isfinite(begun).any():
            out[:, columns] -= np.nanmean(begun)
    return out
