"""The loop that gives friction, backlash and hysteresis away: what a prediction misses of the tip's way, against what pulls it.

As SVG, since the charts that viser has want one rising abscissa for all their lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 320, 200, 40, 34, 8  # of the picture and its margins
MOST = 400  # points a line


@dataclass(frozen=True)
class Loop:
    """Of a trial the pull (n,) that moves it most and its words, the tip (n, 3) m as measured and as predictions have it."""

    words: str
    pull: np.ndarray
    measured: np.ndarray
    predicted: Sequence[np.ndarray]

    def missed(self) -> list[np.ndarray]:
        """(n,) mm, measured minus each prediction, along the direction in which the tip went furthest as the pull rose; NaN where
        it was not seen. Empty where it was seen less than three times."""
        seen = np.isfinite(self.measured).all(axis=1)
        if seen.sum() < 3:
            return []
        about = self.measured[seen] - self.measured[seen].mean(axis=0)
        way = np.linalg.svd(about, full_matrices=False)[2][0]
        way = way if np.dot(about @ way, self.pull[seen]) >= 0.0 else -way
        return [1e3 * (self.measured - tip) @ way for tip in self.predicted]


def svg(loop: Loop, colours: Sequence[str], i: int) -> str:
    """The picture, a dot on each line at sample i; nothing where there is no loop to see."""
    lines, x = loop.missed(), loop.pull
    if not lines or not np.ptp(x) > 0.0:
        return ""
    low, high = min(0.0, *(np.nanmin(y) for y in lines)), max(0.0, *(np.nanmax(y) for y in lines))
    floor = HEIGHT - BELOW
    across = LEFT + (WIDTH - LEFT - 8) * (x - x.min()) / np.ptp(x)

    def up(y: np.ndarray) -> np.ndarray:
        return floor - (floor - ABOVE) * (y - low) / max(high - low, 1e-9)

    none = up(np.zeros(1))[0]
    drawn = [
        f'<path d="M{LEFT} {ABOVE}V{floor}H{WIDTH - 8}" fill="none" stroke="#bbbbbb"/>',
        f'<path d="M{LEFT} {none:.1f}H{WIDTH - 8}" stroke="#dddddd"/>',
    ]
    for y, colour in zip(lines, colours, strict=False):
        at = up(y)
        shown = np.flatnonzero(np.isfinite(at))[:: -(-len(at) // MOST)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across[shown], at[shown], strict=True))
        drawn.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
        if np.isfinite(at[i]):
            drawn.append(f'<circle cx="{across[i]:.1f}" cy="{at[i]:.1f}" r="4" fill="{colour}"/>')
    for a, b, how, told in (
        (LEFT, floor + 13, "middle", _plain(x.min())), (WIDTH - 8, floor + 13, "end", _plain(x.max())),
        (0.5 * (WIDTH + LEFT), HEIGHT - 5, "middle", loop.words),
        (LEFT - 4, ABOVE + 8, "end", _plain(high)), (LEFT - 4, floor, "end", _plain(low)),
    ):  # fmt: skip
        drawn.append(f'<text x="{a}" y="{b}" text-anchor="{how}">{told}</text>')
    return (
        '<div style="padding:0 1em;font-size:12px"><div>missed of the tip\'s way, mm, pulled and let go</div>'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" style="width:100%;font-size:11px">{"".join(drawn)}</svg></div>'
    )


def _plain(value: float) -> str:
    return f"{round(value, 2) + 0.0:g}"
