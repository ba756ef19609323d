"""Plot the error of the predicted tip against the pull, where friction, backlash and hysteresis appear as a loop.

The plot is SVG, since viser's charts need one increasing abscissa for all lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

PICTURE_WIDTH, PICTURE_HEIGHT, LEFT_MARGIN, BOTTOM_MARGIN, TOP_MARGIN = 320, 200, 40, 34, 8  # of the picture and its margins
MOST_LINE_POINTS = 400


@dataclass(frozen=True)
class TipLoop:
    """The strongest pull (n,) of a trial with its label, and the tip (n, 3) m as measured and as predicted.

    Of a robot without markers it is a joint or a tendon (n, 1), SI, `called` so, shown in `unit`, `factor` times SI.
    """

    pull_label: str
    pull: np.ndarray
    measured: np.ndarray
    predicted: Sequence[np.ndarray]
    called: str = "tip along its path"
    unit: str = "mm"
    factor: float = 1e3

    def tip_errors(self) -> list[np.ndarray]:
        """Return measured - predicted (n,), in `unit`, for each prediction, along the direction in which the pull moves the tip.

        NaN where the tip was not measured; empty where it was measured less than three times.
        """
        seen = np.isfinite(self.measured).all(axis=1)
        if seen.sum() < 3:
            return []
        about = self.measured[seen] - self.measured[seen].mean(axis=0)
        way = np.linalg.svd(about, full_matrices=False)[2][0]
        way = way if np.dot(about @ way, self.pull[seen]) >= 0.0 else -way
        return [self.factor * (self.measured - tip) @ way for tip in self.predicted]


def draw_svg(loop: TipLoop, colours: Sequence[str], i: int) -> str:
    """Draw the loops with a dot on each line at sample i; empty where there is no loop."""
    lines, x = loop.tip_errors(), loop.pull
    if not lines or not np.ptp(x) > 0.0:
        return ""
    low, high = min(0.0, *(np.nanmin(y) for y in lines)), max(0.0, *(np.nanmax(y) for y in lines))
    floor = PICTURE_HEIGHT - BOTTOM_MARGIN
    across = LEFT_MARGIN + (PICTURE_WIDTH - LEFT_MARGIN - 8) * (x - x.min()) / np.ptp(x)

    def up(y: np.ndarray) -> np.ndarray:
        return floor - (floor - TOP_MARGIN) * (y - low) / max(high - low, 1e-9)

    none = up(np.zeros(1))[0]
    drawn = [
        f'<path d="M{LEFT_MARGIN} {TOP_MARGIN}V{floor}H{PICTURE_WIDTH - 8}" fill="none" stroke="#bbbbbb"/>',
        f'<path d="M{LEFT_MARGIN} {none:.1f}H{PICTURE_WIDTH - 8}" stroke="#dddddd"/>',
    ]
    for y, colour in zip(lines, colours, strict=False):
        at = up(y)
        shown = np.flatnonzero(np.isfinite(at))[:: -(-len(at) // MOST_LINE_POINTS)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across[shown], at[shown], strict=True))
        drawn.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
        if np.isfinite(at[i]):
            drawn.append(f'<circle cx="{across[i]:.1f}" cy="{at[i]:.1f}" r="4" fill="{colour}"/>')
    for a, b, how, told in (
        (LEFT_MARGIN, floor + 13, "middle", _short_number(x.min())), (PICTURE_WIDTH - 8, floor + 13, "end", _short_number(x.max())),
        (0.5 * (PICTURE_WIDTH + LEFT_MARGIN), PICTURE_HEIGHT - 5, "middle", loop.pull_label),
        (LEFT_MARGIN - 4, TOP_MARGIN + 8, "end", _short_number(high)), (LEFT_MARGIN - 4, floor, "end", _short_number(low)),
    ):  # fmt: skip
        drawn.append(f'<text x="{a}" y="{b}" text-anchor="{how}">{told}</text>')
    return (
        f'<div style="padding:0 1em;font-size:12px"><div>error of the {loop.called}, {loop.unit}, against the pull</div>'
        f'<svg viewBox="0 0 {PICTURE_WIDTH} {PICTURE_HEIGHT}" style="width:100%;font-size:11px">{"".join(drawn)}</svg></div>'
    )


def _short_number(value: float) -> str:
    return f"{round(value, 2) + 0.0:g}"
