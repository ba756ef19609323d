"""Values as colours, and the labelled bar that says which is which."""

from __future__ import annotations

import numpy as np

from twin.figure import Range

# Five points of viridis (S. van der Walt and N. Smith, CC0), which reads in grey and to colour-blind eyes.
STOPS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], float)


def colours(values: np.ndarray, over: Range) -> np.ndarray:
    """(..., 3) bytes of SI values; those beyond the ends have the ends' colours."""
    share = np.clip((over.factor * (values - over.zero) - over.low) / max(over.high - over.low, 1e-12), 0.0, 1.0) * (len(STOPS) - 1)
    return np.stack([np.interp(share, np.arange(len(STOPS)), c) for c in STOPS.T], axis=-1).astype(np.uint8)


def bar(over: Range) -> str:
    """The bar as HTML."""
    stops = ", ".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in STOPS)
    middle = 0.5 * (over.low + over.high)
    return (
        f'<div style="padding:0 1em;font-size:12px"><div>{over.name}, {over.unit}</div>'
        f'<div style="height:12px;border-radius:3px;background:linear-gradient(to right,{stops})"></div>'
        '<div style="display:flex;justify-content:space-between">'
        f"<span>{over.low:.3g}</span><span>{middle:.3g}</span><span>{over.high:.3g}</span></div></div>"
    )
