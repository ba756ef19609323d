"""What is each rule of the decision worth? Rules are taken out, and the answers counted again.

    python -m tools.benchmarks.diagnosis.ablation --out results/ [--sets 60] [--seed 30000] [--jobs 2]

The days are those of the attribution benchmark, and with `--second DIR` those of the second rod simulator. A day is calibrated
once. Then everything from the search to the verdict is run by all rules, and again without all of those in `rules.py`; where that
changes the answer, without either half of them, and so on down to single rules. Fits that an earlier run of the day has made are
not repeated. Rows go to results/ablation.jsonl as they come, so an interrupted run resumes. Days with an even seed are for
developing, the others only for reporting.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.days.attribution import Case, plan
from tools.benchmarks.diagnosis.days.attribution_table import exact, false_positive, first, flagged, made, right
from tools.benchmarks.diagnosis.days.second_bench_days import true_row
from tools.benchmarks.diagnosis.memory import Memory
from tools.benchmarks.diagnosis.rules import RULES, Rule, without
from tools.benchmarks.table import Row, kept_rows, markdown
from tools.simulators.rod.day import make_set
from tools.simulators.rod.mechanics.rod import NoEquilibrium
from twin.diagnosis import Settings
from twin.diagnosis.calibration.calibrate import calibrate
from twin.diagnosis.checks.preview import DataPreview, preview_data
from twin.diagnosis.conclusion import Conclusion
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext, silent
from twin.diagnosis.held_out import HeldOut
from twin.diagnosis.pipeline import decide
from twin.diagnosis.search.screen import screen
from twin.diagnosis.verdict.judge import withdraw
from twin.foundation.errors import TwinError
from twin.foundation.parallel import single_thread
from twin.measurements import Recording, read
from twin.prediction.own_clocks import on_rows_of_outputs
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin

AS_IT_IS = "as it is"
NO_WITHDRAWAL = "claims no better on held-out trials are withdrawn"
TOGETHER = "several together, none of them by itself"


class Day:
    """A day that is calibrated once and decided again and again."""

    def __init__(self, recording: Recording, seed: int) -> None:
        twin, self.settings = Twin.of_recording(recording), Settings(seed=seed, jobs=1)
        log = on_rows_of_outputs(recording)
        self.preview: DataPreview = preview_data(prepare(log, twin.robot), twin, self.settings)
        self.memory = Memory()
        p = self.preview
        with self.memory.in_force():
            found = calibrate(p.prepared, twin, p.held_out, p.nominal, self.settings, silent)
        self.context: FitContext = found[0]
        self.base: ScoredModel = found[1]
        self.floor: float | None = None  # m, of a marker on held-out trials
        self.seen: dict[str, tuple[bool, dict[str, float], dict[str, float]]] = {}

    def answers(self, rules: tuple[Rule, ...]) -> Iterator[tuple[str, Row]]:
        """Yield the answer by all rules, and the names of those without which it is another, each with that answer."""
        as_it_is = self._answer((), True)
        yield AS_IT_IS, as_it_is
        yield NO_WITHDRAWAL, self._answer((), False)
        yield from self._deciding(rules, as_it_is)

    def _deciding(self, rules: tuple[Rule, ...], known: Row) -> Iterator[tuple[str, Row]]:
        now = self._answer(rules, True)
        if _same(now, known):
            return
        if len(rules) == 1:
            yield rules[0].name, now
            return
        half = len(rules) // 2
        deciding = [*self._deciding(rules[:half], known), *self._deciding(rules[half:], known)]
        yield from deciding or [(TOGETHER, {**now, "rules": [r.name for r in rules]})]

    def _answer(self, rules: tuple[Rule, ...], withdraws: bool) -> Row:
        with self.memory.in_force(), without(rules, self.memory):
            screening = screen(self.context, self.base, self.settings.seed)
            try:
                found, gated, judged = decide(self.context, self.base, screening)
            except TwinError as error:
                return {"verdict": "no answer", "claims": [], "probability": [], "description": str(error)}
        out = Conclusion(self.context, screening, found, gated, judged, ())
        improved, calibrated, after = self._errors(out)
        if judged.claims and withdraws and not improved:
            judged, after = withdraw(self.context, found, judged), calibrated
        return {
            "verdict": judged.verdict, "claims": [c.effect for c in judged.claims],
            "probability": [c.probability for c in judged.claims],
            "after": after.get("marker"), "calibrated": calibrated.get("marker"),
        }  # fmt: skip

    def _errors(self, out: Conclusion) -> tuple[bool, dict[str, float], dict[str, float]]:
        """Return whether the effects reduce the held-out error, and the errors (m) before and after, by group."""
        key = repr(out.final.values) + repr([(e.id, e.values) for e in out.final.effects])
        if key not in self.seen:
            held = HeldOut.of(self.preview.prepared, self.preview.nominal, [(out, self.preview.held_out)])
            e = held.errors(self.settings.seed)
            self.seen[key] = e.improved, e.calibrated, e.after
            self.floor = e.floor.get("marker")
        return self.seen[key]


def run(case: Case, folder: Path) -> Row:
    """Make one day, and return its answers by rule."""
    where = folder / f"set_{case.seed}"
    shutil.rmtree(where, ignore_errors=True)
    told: Row = {**asdict(case), "true": list(case.effects)}
    try:
        make_set(where, case.recipe())
        truth = json.loads((where / "truth.json").read_text())["effects"]
        return {**told, "sigmas": [e["sigmas"] for e in truth], **_decided(where, case.seed)}
    except (TwinError, NoEquilibrium) as error:
        return {**told, "not made": str(error)}
    finally:
        shutil.rmtree(where, ignore_errors=True)


def run_second(day: Path) -> Row:
    """Return the answers by rule of one day of the second rod simulator, made before."""
    told: Row = {"seed": int("".join(c for c in day.name if c.isdigit()) or 0), "amplitude": 0.0, **true_row(day)}
    try:
        return {**told, **_decided(day, 1)}
    except TwinError as error:
        return {**told, "not made": str(error)}


def _decided(folder: Path, seed: int) -> Row:
    with single_thread():
        day = Day(read(folder), seed)
        answers = dict(day.answers(RULES))
    return {"floor": day.floor, "answers": answers}


def counts(rows: list[Row], rule: str) -> dict[str, tuple[int, int]]:
    """Return, of the days' answers without a rule, how many hold and of how many, by what is counted."""
    told = [{**r, **r["answers"].get(rule, r["answers"][AS_IT_IS])} for r in rows]
    of = {kind: [r for r in told if r["kind"] == kind] for kind in ("none", "one", "pair", "unknown")}
    known = [*of["one"], *of["pair"]]
    wrong = [r["verdict"] == "explained" and not all(right(r, c) for c in r["claims"]) for r in told]
    counted = {
        "false": [false_positive(r) for r in of["none"]],
        "one first": [first(r) for r in of["one"]],
        "one exact": [exact(r) for r in of["one"]],
        "pair first": [first(r) for r in of["pair"]],
        "pair exact": [exact(r) for r in of["pair"]],
        "flagged": [flagged(r) for r in of["unknown"]],
        "wrong, no flag": wrong,
        "explained": [r["verdict"] == "explained" for r in known],
        "after/floor < 1.1": [r["after"] < 1.1 * r["floor"] for r in known if r.get("after")],
        "worse": [r["after"] > 1.001 * r["calibrated"] for r in told if r.get("after")],
    }
    return {name: (sum(hits), len(hits)) for name, hits in counted.items()}


def table(rows: list[Row]) -> str:
    """Return a Markdown table for each half: the counts by all rules, and how they change without each."""
    out = []
    for name, odd in (("developing", 0), ("reporting", 1)):
        half = [r for r in rows if r["seed"] % 2 == odd and made(r)]
        if not half:
            continue
        base = counts(half, AS_IT_IS)
        lines: list[list[object]] = [[AS_IT_IS, "", *(f"{a}/{n}" for a, n in base.values())]]
        for rule in (NO_WITHDRAWAL, TOGETHER, *(r.name for r in RULES)):
            now = counts(half, rule)
            moved = sum(not _same(r["answers"].get(rule, r["answers"][AS_IT_IS]), r["answers"][AS_IT_IS]) for r in half)
            lines.append([rule, moved, *(_change(now[k][0] - base[k][0]) for k in base)])
        out.append(f"Days for {name}: {len(half)}\n\n" + markdown(["without", "days it decides", *base], lines))
    return "\n\n".join(out)


def _same(a: Row, b: Row) -> bool:
    return a["verdict"] == b["verdict"] and a["claims"] == b["claims"]


def _change(n: int) -> str:
    return f"{n:+d}" if n else ""


def main(out: Path, sets: int = 60, seed: int = 30000, second: Path | None = None, jobs: int = 1) -> None:
    """Decide fresh days with rules taken out, and print the tables of both halves.

    Args:
        out: folder of ablation.jsonl
        second: also the days in this folder, which `python -m tools.simulators.second_rod` has written
        jobs: days side by side, each on one core
    """
    work = {case.seed: delayed(run)(case, out) for case in plan(sets, seed)}
    if second:
        work |= {day.name: delayed(run_second)(day) for day in sorted((second / "sets").iterdir())}

    def told(row: Row) -> str:
        return f"{row['seed']} {row['true']} {row.get('not made') or row['answers'][AS_IT_IS]}"

    print(table([r for r in kept_rows(out / "ablation.jsonl", work, jobs, told) if "answers" in r]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
