"""Point clouds: in another unit than metres, of another body, and away from the markers of the same instant."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import KDTree

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.thresholds import CLOUD_DISTANCE_RATIO, CLOUD_WIDTH_RATIO, UNIT_MISTAKE_RATIO
from twin.measurements import Clouds
from twin.measurements.patches import N_BANDS, N_PATCHES

KIND = "point clouds"


def clouds(case: Case) -> Iterator[Suspicion]:
    """Clouds as large as no robot of this kind, or that stand off the markers: of another frame or another robot.

    A marker on the skin that the camera sees is as near to a point of the cloud as these are to each other.
    """
    of = {t.name: t.clouds for t in case.prepared.recording.trials}
    seen = {k: c for k in case.trials if (c := of[case.prepared.inputs[k].name]) is not None and len(c.points)}
    if not seen:
        return
    size = float(np.median([np.linalg.norm(np.ptp(c.points, axis=0)) for c in seen.values()]))
    robot = float(case.twin.body().spec.compile().stat.extent)
    if not 1.0 / UNIT_MISTAKE_RATIO < size / robot < UNIT_MISTAKE_RATIO:
        unit, factor = ("mm", 1e-3) if size > robot else ("km", 1e3)
        words = f"the clouds are {size:.3g} m across and the robot {robot:.2g} m"
        yield Suspicion(KIND, words, f"write `points` in metres: as they stand they would be {unit} (times {factor:g})")
        return
    yield from _width(case)
    names, columns = case.points()
    if not names:
        return
    near = [_nearest(case.prepared.measured[k][:, columns], case.prepared.inputs[k].time, c) for k, c in seen.items()]
    off, spacing = (np.concatenate([n[part] for n in near]) for part in (0, 1))
    if off.size and np.median(off) > CLOUD_DISTANCE_RATIO * np.median(spacing):
        words = (
            f"markers {names[0]} to {names[-1]} stand {1e3 * np.median(off):.1f} mm off the nearest of their clouds, whose points "
            f"are {1e3 * np.median(spacing):.1f} mm apart (medians)"
        )
        change = "give clouds and markers in the base frame, both of this robot and by the trial's own clock, or leave out `cloud`"
        yield Suspicion(KIND, words, change)


def _width(case: Case) -> Iterator[Suspicion]:
    """Clouds that are compared, of a body thicker or thinner near its base, where it hardly moves, than the one described."""
    near = [j for j in case.columns("skin") if case.prepared.outputs[j].index < N_PATCHES // N_BANDS]
    if case.predicted is None or not near:
        return
    seen, shown = (np.concatenate([v[k] for k in case.trials])[:, near] for v in (case.prepared.measured, case.predicted))
    there = np.isfinite(seen) & np.isfinite(shown)
    if not there.any():
        return
    stands, described = float(np.median(seen[there])), float(np.median(shown[there]))
    if not 1.0 / CLOUD_WIDTH_RATIO < stands / described < CLOUD_WIDTH_RATIO:
        words = f"near the base the clouds stand {1e3 * stands:.1f} mm off the axis, and the robot's skin {1e3 * described:.1f} mm"
        yield Suspicion(KIND, words, "give clouds in the base frame, of this robot, or leave out `cloud`")


def _nearest(markers: np.ndarray, time: np.ndarray, clouds: Clouds) -> tuple[np.ndarray, np.ndarray]:
    """Distances (m) of markers (n, m, 3), at the row next to each frame, from its nearest point; and of its points from theirs."""
    off, spacing = [np.empty(0)], [np.empty(0)]
    for t, a, b in zip(clouds.time, clouds.offsets[:-1], clouds.offsets[1:], strict=True):
        points, there = clouds.points[a:b], markers[np.argmin(np.abs(time - t))]
        there = there[np.isfinite(there).all(axis=1)]
        if len(points) > 1 and len(there):
            tree = KDTree(points)
            off.append(tree.query(there)[0])
            spacing.append(tree.query(points, k=2)[0][:, 1])
    return np.concatenate(off), np.concatenate(spacing)
