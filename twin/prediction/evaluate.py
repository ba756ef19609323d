"""The error of a given twin on given data. Nothing is fitted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.measurements import Recording
from twin.prediction.own_clocks import on_rows_of_outputs
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import is_dynamic, simulate
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class OutputGroup:
    """A group of outputs: how it is shown, and what is known of its sensors."""

    unit: str  # shown
    factor: float  # from SI to that unit
    kind: str  # name in reports
    typical_noise: float  # SI, of a usual sensor, until the noise is estimated
    is_point: bool = False  # whether its channels are the x, y and z of points
    is_vector: bool = False  # of points, or of rotation vectors: three make one error
    has_declared_accuracy: bool = False  # whether a robot's declared accuracy is about it


OUTPUT_GROUPS = {
    "marker": OutputGroup("mm", 1e3, "position", 2.5e-4, is_point=True, is_vector=True, has_declared_accuracy=True),
    "displacement": OutputGroup("mm", 1e3, "tendon_displacement", 5e-5),
    "tension": OutputGroup("N", 1.0, "tendon_tension", 2e-2),
    "temperature": OutputGroup("K", 1.0, "sma_temperature", 0.5),
    "resistance": OutputGroup("ohm", 1.0, "sma_resistance", 5e-3),
    "sensor": OutputGroup("ohm", 1.0, "sensor_resistance", 0.5),
    "angle": OutputGroup("deg", 180.0 / np.pi, "joint_angle", 2e-3, has_declared_accuracy=True),
    "torque": OutputGroup("N*m", 1.0, "joint_torque", 1e-3),
    "turn": OutputGroup("deg", 180.0 / np.pi, "orientation", 5e-3, is_vector=True),
    "angles": OutputGroup("deg", 180.0 / np.pi, "orientation_angle", 5e-3),
    "imu rate": OutputGroup("deg/s", 180.0 / np.pi, "imu_rate", 5e-3),
    "imu force": OutputGroup("m/s^2", 1.0, "imu_acceleration", 5e-2),
    "motor angle": OutputGroup("deg", 180.0 / np.pi, "motor_angle", 2e-3),
    "motor torque": OutputGroup("N*m", 1.0, "motor_torque", 1e-3),
    "motor current": OutputGroup("A", 1.0, "motor_current", 5e-3),
    "joint angle": OutputGroup("deg", 180.0 / np.pi, "joint_angle", 1e-3),
    "joint shift": OutputGroup("mm", 1e3, "joint_position", 5e-5),
    "joint rate": OutputGroup("rad/s", 1.0, "joint_rate", 2e-2),
    "joint speed": OutputGroup("mm/s", 1e3, "joint_speed", 1e-3),
    "joint torque": OutputGroup("N*m", 1.0, "joint_torque", 1e-2),
    "joint force": OutputGroup("N", 1.0, "joint_force", 2e-2),
    "actuator angle": OutputGroup("deg", 180.0 / np.pi, "motor_angle", 1e-3),
    "actuator length": OutputGroup("mm", 1e3, "motor_position", 2e-5),
    "actuator rate": OutputGroup("rad/s", 1.0, "motor_rate", 2e-2),
    "actuator speed": OutputGroup("mm/s", 1e3, "motor_speed", 1e-3),
    "actuator torque": OutputGroup("N*m", 1.0, "motor_torque", 1e-2),
    "actuator force": OutputGroup("N", 1.0, "motor_force", 2e-2),
    "tendon length": OutputGroup("mm", 1e3, "tendon_length", 5e-5),
    "tendon speed": OutputGroup("mm/s", 1e3, "tendon_speed", 1e-3),
    "tendon tension": OutputGroup("N", 1.0, "tendon_tension", 2e-2),
    **{
        f"sensor [{unit}]": OutputGroup(unit, 1.0, "sensor" if unit == "1" else f"sensor_{unit}", 1e-2)
        for unit in ("1", "rad", "m", "N*m", "N", "rad/s", "m/s", "m/s^2", "rad/s^2")
    },
    "skin": OutputGroup("mm", 1e3, "skin", 2e-4, has_declared_accuracy=True),
}


def headline_group(groups: Iterable[str]) -> str:
    """Return the group of outputs whose error stands for the twin: markers if there are any, else skin, else the first."""
    groups = list(groups)
    return next((g for g in ("marker", "skin") if g in groups), groups[0])


def squared_errors(prepared: PreparedRecording, raw: Sequence[np.ndarray], group: str) -> list[np.ndarray]:
    """Return the squared errors of a group, one array a trial: per sample and complete marker or rotation (Euclidean), or
    per sample and channel."""
    out = []
    for r in raw:
        if OUTPUT_GROUPS[group].is_vector:
            places = dict.fromkeys(o.index for o in prepared.outputs if o.group == group)
            columns = [[j for j, o in enumerate(prepared.outputs) if o.group == group and o.index == m] for m in places]
            found = np.concatenate([(r[:, c] ** 2).sum(axis=1) for c in columns])
        else:
            found = r[:, [j for j, o in enumerate(prepared.outputs) if o.group == group]].ravel() ** 2
        out.append(found[np.isfinite(found)])
    return out


def rms(prepared: PreparedRecording, raw: Sequence[np.ndarray], group: str) -> float:
    """Return the root-mean-square of residuals (n_k, n_output) of one group, SI; NaN where nothing was measured."""
    found = np.concatenate(squared_errors(prepared, raw, group))
    return float(np.sqrt(found.mean())) if found.size else float("nan")


def evaluate(twin: Twin, recording: Recording) -> dict[str, Any]:
    """Return the `error` block of the report contract for one twin.

    Unit, trials, rmse (of positions where there are any), by_kind, by_channel (root-mean-square of the channel alone). Raises
    TwinError for data that the twin cannot be compared with.
    """
    prepared = prepare(on_rows_of_outputs(recording), twin.robot)
    traces = simulate(twin, prepared, dynamic=is_dynamic(prepared))
    raw = [y - t.outputs(twin, prepared) for y, t in zip(prepared.measured, traces, strict=True)]
    groups = list(dict.fromkeys(o.group for o in prepared.outputs))
    shown = {g: OUTPUT_GROUPS[g] for g in groups}
    by_kind = {o.kind: {"unit": o.unit, "rmse": _or_none(o.factor * rms(prepared, raw, g))} for g, o in shown.items()}
    everything = np.concatenate(raw)
    by_channel = {
        o.channel.name: {
            "unit": shown[o.group].unit,
            "rmse": _or_none(shown[o.group].factor * _channel_rms(everything[:, j])),
        }
        for j, o in enumerate(prepared.outputs)
    }
    first = by_kind[shown[headline_group(groups)].kind]
    return {"trials": [t.label for t in recording.trials], **first, "by_kind": by_kind, "by_channel": by_channel}


def _channel_rms(r: np.ndarray) -> float:
    r = r[np.isfinite(r)]
    return float(np.sqrt(np.mean(r**2))) if r.size else float("nan")


def _or_none(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
