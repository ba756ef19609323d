"""One page of figures on shape from strain: error by estimator, deformation, noise and number of clouds; what the 90 % band holds
by deformation; estimated surfaces coloured by error against true ones; cost of each estimator.

    python -m tools.simulators.finger --shape --seed 22 --out DAY
    python -m tools.benchmarks.shape.page DAY [DAY ...] --out shape.html

Days are of an independent finite element bench, with truth. Noise, clouds, surfaces and cost are of the first day.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import tyro
from plotly.io import to_html
from plotly.subplots import make_subplots

import tools.benchmarks.shape.baselines  # noqa: F401  # adds the baselines to the estimators
from tools.benchmarks.shape.error import score
from twin.measurements import Clouds, Recording, read
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.align import Alignment, align
from twin.shape.estimators.estimator import Z90, Estimator, estimator_class, estimators
from twin.shape.predict import predict_shapes

SIZES = np.array([0.0, 1.0, 2.0, 4.0, 6.0, 9.0, 13.0, 20.0])  # mm
NOISE = (0.0, 1.0, 3.0, 10.0)  # ohm, beside the day's own 0.3
EVERY = (1, 3, 8, 20)  # one cloud in so many
RINGS, AROUND = 21, 20  # of the named points on the mantle, in their order
COLOURS = ("#1f6f8b", "#b0413e", "#d9a441", "#5b8e5a", "#7b5ea7", "#777777")


@dataclass(frozen=True)
class Day:
    folder: Path
    recording: Recording
    aligned: Alignment

    @staticmethod
    def of(folder: Path) -> Day:
        recording = read(folder / "measured")
        return Day(folder, recording, align(recording, Twin.of(load("finger"))))

    @property
    def twin(self) -> Twin:
        return self.aligned.twin

    @property
    def judged(self) -> Recording:
        return self.recording.select([t.name for t in self.recording.trials if t.name.startswith("test")])

    def error(self, law: Estimator, recording: Recording) -> float:
        """Mean vertex error, mm."""
        return float(np.mean(list(score(self.folder / "shape_truth.npz", predict_shapes(recording, law)[0], 0.0).error.values())))


@dataclass(frozen=True)
class Frames:
    """True and estimated places (n, P, 3) mm of a day's judged frames, their standard deviations (n, P) mm, and ms a frame."""

    true: np.ndarray
    found: np.ndarray
    std: np.ndarray
    cost: float

    @staticmethod
    def of(day: Day, name: str) -> Frames:
        law = estimator_class(name)(day.twin)
        began, recording = time.perf_counter(), day.judged
        arrays, spent = predict_shapes(recording, law, day.aligned.widening)[0], time.perf_counter()
        true, places, found, std = np.load(day.folder / "shape_truth.npz"), [], [], []
        for trial in recording.trials:
            at = np.abs(arrays[f"{trial.label}_time"][None] - true[f"{trial.label}_time"][:, None]).argmin(axis=1)
            found.append(1e3 * arrays[f"{trial.label}_vertices"][at])
            std.append(1e3 * arrays[f"{trial.label}_std"][at])
            places.append(true[f"{trial.label}_vertices"] * float(true["unit_mm"]))
        rows = sum(len(t.time) for t in recording.trials)
        return Frames(np.concatenate(places), np.concatenate(found), np.concatenate(std), 1e3 * (spent - began) / rows)

    @property
    def error(self) -> np.ndarray:
        """(n, P) mm."""
        return np.linalg.norm(self.found - self.true, axis=2)

    @property
    def inside(self) -> np.ndarray:
        """(n,) per cent of the points in the band."""
        return 100.0 * (self.error <= Z90 * self.std).mean(axis=1)


def noisy(recording: Recording, ohm: float) -> Recording:
    rng = np.random.default_rng(0)
    values = [
        {n: v + ohm * rng.normal(size=len(v)) for n, v in t.values.items() if n.endswith("_resistance")} for t in recording.trials
    ]
    return recording.with_values(values, recording.source)


def thinned(recording: Recording, every: int) -> tuple[Recording, int]:
    """With one cloud in `every`, and how many that are."""
    trials, count = [], 0
    for trial in recording.trials:
        if (c := trial.clouds) is not None:
            keep = np.arange(0, len(c.time), every)
            parts = [c.points[c.offsets[f] : c.offsets[f + 1]] for f in keep]
            offsets = np.cumsum([0, *map(len, parts)])
            trial, count = replace(trial, clouds=Clouds(np.concatenate(parts), offsets, c.time[keep])), count + len(keep)
        trials.append(trial)
    return replace(recording, trials=tuple(trials)), count


def curves(days: Sequence[Day], names: Sequence[str], frames: dict[str, list[Frames]]) -> go.Figure:
    """Error by estimator, by deformation, by noise and by number of clouds; cost."""
    titles = (
        "by estimator and day", "by mean displacement, mm", "by noise added to resistances, ohm", "by number of clouds aligned to",
        "cost of a frame on one busy core, ms (with the skin)", "points in the 90 % band by mean displacement, mm",
    )  # fmt: skip
    page, first = make_subplots(rows=3, cols=2, subplot_titles=titles, vertical_spacing=0.1), days[0]
    rest = load("finger")
    fewer = [thinned(first.recording, every) for every in EVERY]
    twins = [(count, align(recording, Twin.of(rest)).twin) for recording, count in fewer]
    for colour, name in zip(COLOURS, names, strict=False):
        style = {"name": name, "legendgroup": name, "marker_color": colour}
        law, line = estimator_class(name), {**style, "showlegend": False, "mode": "lines+markers"}
        page.add_bar(x=[d.folder.name for d in days], y=[f.error.mean() for f in frames[name]], **style, row=1, col=1)
        pairs = zip(days, frames[name], strict=True)
        size = np.concatenate([np.linalg.norm(f.true - _undeformed(d), axis=2).mean(axis=1) for d, f in pairs])
        error = np.concatenate([f.error.mean(axis=1) for f in frames[name]])
        at = np.digitize(size, SIZES)
        bins = [k for k in range(1, len(SIZES)) if (at == k).sum() > 3]
        page.add_scatter(x=[size[at == k].mean() for k in bins], y=[error[at == k].mean() for k in bins], **line, row=1, col=2)
        noise = [first.error(law(first.twin), noisy(first.judged, ohm)) for ohm in NOISE]
        page.add_scatter(x=NOISE, y=noise, **line, row=2, col=1)
        clouds = [first.error(law(twin), first.judged) for _, twin in twins]
        page.add_scatter(x=[count for count, _ in twins], y=clouds, **line, row=2, col=2)
        held = np.concatenate([f.inside for f in frames[name]])
        page.add_scatter(x=[size[at == k].mean() for k in bins], y=[held[at == k].mean() for k in bins], **line, row=3, col=2)
        page.add_bar(x=[name], y=[frames[name][0].cost], **{**style, "showlegend": False}, row=3, col=1)
    page.update_yaxes(title_text="mean vertex error, mm", rangemode="tozero")
    page.update_yaxes(title_text="ms", type="log", rangemode="normal", row=3, col=1)
    page.update_yaxes(title_text="%", rangemode="normal", row=3, col=2)
    page.add_hline(y=90.0, line_dash="dot", row=3, col=2)  # type: ignore[arg-type]  # plotly's annotation lacks int
    return page.update_layout(height=1200, template="plotly_white", barmode="group", title="Shape from four strain sensors: error")


def _undeformed(day: Day) -> np.ndarray:
    return np.load(day.folder / "shape_truth.npz")["undeformed"]


def surfaces(names: Sequence[str], frames: dict[str, list[Frames]]) -> go.Figure:
    """The frame that moved furthest on average and the one that the first estimator has worst, of every estimator."""
    some = frames[names[0]][0]
    chosen = {
        "furthest bent": int(np.linalg.norm(some.true - some.true[0], axis=2).mean(axis=1).argmax()),
        f"worst of {names[0]}": int(some.error.mean(axis=1).argmax()),
    }
    titles = [f"{name}: {words}" for words in chosen for name in names]
    kind = [[{"type": "scene"}] * len(names) for _ in chosen]
    page = make_subplots(rows=len(chosen), cols=len(names), specs=kind, subplot_titles=titles, horizontal_spacing=0.0)
    i, j, k = _triangles()
    for row, frame in enumerate(chosen.values(), 1):
        for col, name in enumerate(names, 1):
            f = frames[name][0]
            x, y, z = f.found[frame][: RINGS * AROUND].T
            error = f.error[frame][: RINGS * AROUND]
            page.add_mesh3d(
                x=x, y=y, z=z, i=i, j=j, k=k, intensity=error, coloraxis="coloraxis", hoverinfo="skip", row=row, col=col
            )
            tx, ty, tz = f.true[frame][: RINGS * AROUND].T
            dots = {"size": 1.5, "color": "black"}
            page.add_scatter3d(x=tx, y=ty, z=tz, mode="markers", marker=dots, hoverinfo="skip", showlegend=False, row=row, col=col)
    page.update_scenes(aspectmode="data", camera_eye={"x": 2.0, "y": 1.5, "z": 0.4})
    bar = {"colorscale": "Viridis", "cmin": 0.0, "cmax": 3.0, "colorbar_title": "error, mm"}
    return page.update_layout(height=900, coloraxis=bar, title="Estimated surfaces, coloured by error; true ones: dots")


def _triangles() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the mantle: two a piece between neighbouring rings."""
    point = np.arange(RINGS * AROUND).reshape(RINGS, AROUND)
    a, b = point[:-1], np.roll(point, -1, axis=1)[:-1]
    c, d = point[1:], np.roll(point, -1, axis=1)[1:]
    return tuple(np.concatenate([p.ravel(), q.ravel()]) for p, q in ((a, b), (b, d), (c, c)))  # type: ignore[return-value]


def main(
    days: tyro.conf.Positional[tuple[Path, ...]],
    out: Path,
    estimators: str = ",".join(sorted(estimators(), key=lambda n: n != "modal")),
) -> None:
    """Write the page on so many days, of estimators with commas between."""
    names, every = estimators.split(","), [Day.of(folder) for folder in days]
    frames = {name: [Frames.of(day, name) for day in every] for name in names}
    figures = curves(every, names, frames), surfaces(names, frames)
    head = '<!doctype html><meta charset="utf-8"><title>Shape from strain</title>'
    bodies = [to_html(figure, full_html=False, include_plotlyjs=k == 0) for k, figure in enumerate(figures)]
    out.write_text("\n".join([head, *bodies]), "utf-8")
    print(out)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
