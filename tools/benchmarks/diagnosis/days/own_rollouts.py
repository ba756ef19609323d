"""Is a twin's own rollout diagnosed as what it is? Robots, drives, rates and effects, each rolled out and diagnosed.

    python -m tools.benchmarks.diagnosis.days.own_rollouts --out results/ [--jobs 2] [--robots continuum --rates 10]

A robot as described, with nothing or one effect, is rolled out under drawn commands with marker noise, as `twin rollout` does; the
described robot diagnoses it. Nothing is found out about robots here, only whether rollouts and the diagnosis tell one story of
motion: a body's own damping is no lag. Rows go to results/own_rollouts.jsonl as they come; a run goes on where it stopped.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.answer import in_words, no_answer
from tools.benchmarks.table import Row, kept_rows, markdown, share
from twin.body import Drive
from twin.diagnosis import Settings, diagnose
from twin.effects import effect_class
from twin.effects.base.scaling import scaled_effect
from twin.foundation.errors import TwinError
from twin.prediction.evaluate import evaluate
from twin.prediction.rollout import Drawing, draw_controls, rollout
from twin.prediction.twin import Twin
from twin.robots import load

ROBOTS = ("continuum", "three_cable", "finger", "two_link", "tendon_leg")
RATES = (2.0, 10.0, 50.0)  # Hz
# Of an effect, the first law that acts on the robot.
EFFECTS: dict[str, tuple[tuple[str, dict[str, float]], ...]] = {
    "none": (),
    "friction": (("joint_friction", {"torque_hip": 0.05, "torque_knee": 0.03}), ("tendon_friction", {"mu": 0.2})),
    "lag": (("actuator_lag", {"time": 0.3}),),
    "payload": (("tip_payload", {"mass": 0.02}),),
}
NOISE = 2.5e-4  # m of a marker
TRIALS = 8
SEEN = 1.0  # sigma: an effect that moves the markers by less need not be found


@dataclass(frozen=True)
class Case:
    """A robot, the drive of its tendons, the rate of the log (Hz) and the kind of effect."""

    robot: str
    drive: str
    rate: float
    effect: str

    @property
    def day(self) -> str:
        """Its name among the rows."""
        return f"{self.robot} {self.drive} {self.rate:g} Hz {self.effect}"


def cases(robots: tuple[str, ...] = ROBOTS, rates: tuple[float, ...] = RATES) -> list[Case]:
    """Return the cases of these robots, each with the drives it has."""
    found = []
    for robot in robots:
        ports = load(robot).build().ports
        drives = [d for d in (Drive.TENSION, Drive.DISPLACEMENT, Drive.CONTROL) if all(any(p.drive is d for p in t) for t in ports)]
        found += [Case(robot, str(d), rate, effect) for d, rate, effect in product(drives, rates, EFFECTS)]
    return found


def run(case: Case, seed: int) -> Row:
    """Roll out one case, diagnose it, and return what was found."""
    robot = load(case.robot)
    laws = [(name, values) for name, values in EFFECTS[case.effect] if effect_class(name).needs <= robot.build().features]
    weightless = case.effect == "payload" and not np.any(robot.gravity)
    if case.effect != "none" and (weightless or not laws):
        return {**asdict(case), "day": case.day, "not made": "no such effect acts on it"}
    described = Twin.of(robot)
    effects = [scaled_effect(effect_class(name), values, robot.n_tendon, robot.size) for name, values in laws[:1]]
    true = Twin(robot, {}, tuple(effects))
    drive = Drive(case.drive)
    drawing = Drawing(rate=case.rate) if drive is Drive.CONTROL else Drawing(rate=case.rate, drive=drive)
    row: Row = {**asdict(case), "day": case.day, "law": laws[0][0] if laws else ""}
    began = time.perf_counter()
    try:
        recording = rollout(true, draw_controls(described, TRIALS, seed, drawing), noise=NOISE, seed=seed).recording
        row["sigma"] = 1e-3 * float(evaluate(described, recording)["rmse"]) / (np.sqrt(3.0) * NOISE)
        found = diagnose(recording, described, Settings(seed=seed, jobs=1))
    except TwinError as error:
        return {**row, **no_answer(error)}
    return {**row, "verdict": found.verdict, "claims": [c.effect for c in found.claims], "seconds": time.perf_counter() - began}


def right(row: Row) -> bool:
    """Return whether nothing is claimed of a robot without an effect, or its effect comes first."""
    return row["claims"][:1] == ([row["law"]] if row["law"] else [])


def table(rows: list[Row]) -> str:
    """Return the shares by robot and drive, and every case that went wrong."""
    made = [r for r in rows if "not made" not in r]
    seen = [r for r in made if not r["law"] or r.get("sigma", np.inf) >= SEEN]
    lines = []
    for key in dict.fromkeys((r["robot"], r["drive"]) for r in made):
        mine = [r for r in seen if (r["robot"], r["drive"]) == key]
        lines.append([*key, share([not right(r) for r in mine if not r["law"]]), share([right(r) for r in mine if r["law"]])])
    lines.append(["all", "", share([not right(r) for r in seen if not r["law"]]), share([right(r) for r in seen if r["law"]])])
    wrong = [f"  {r['day']}: {in_words(r)}" for r in seen if not right(r)]
    return "\n".join([markdown(["robot", "drive", "false", "right first"], lines), "", *wrong])


def main(out: Path, robots: tuple[str, ...] = ROBOTS, rates: tuple[float, ...] = RATES, seed: int = 47000, jobs: int = 1) -> None:
    """Roll out, diagnose and score.

    Args:
        out: folder of own_rollouts.jsonl
        jobs: cases side by side, each on one core
    """
    work = {c.day: delayed(run)(c, seed) for c in cases(robots, rates)}
    rows = kept_rows(out / "own_rollouts.jsonl", work, jobs, lambda row: f"{row['day']}: {row.get('not made') or in_words(row)}")
    print(table(rows))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
