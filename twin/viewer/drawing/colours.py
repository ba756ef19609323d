"""Map values to colours, and draw the labelled colour bar."""

import numpy as np

from twin.body.drawable import ColourScale

# Five points of viridis (S. van der Walt and N. Smith, CC0), readable in grey and with colour blindness.
VIRIDIS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], float)


def colour_values(values: np.ndarray, over: ColourScale) -> np.ndarray:
    """Return the colours (..., 3), bytes, of SI values; values beyond the range get the colour of its end."""
    share = np.clip((over.factor * (values - over.zero) - over.low) / max(over.high - over.low, 1e-12), 0.0, 1.0) * (
        len(VIRIDIS) - 1
    )
    return np.stack([np.interp(share, np.arange(len(VIRIDIS)), c) for c in VIRIDIS.T], axis=-1).astype(np.uint8)


def colour_bar(over: ColourScale) -> str:
    """Return the colour bar as HTML."""
    stops = ", ".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in VIRIDIS)
    middle = 0.5 * (over.low + over.high)
    return (
        f'<div style="padding:0 1em;font-size:12px"><div>{over.name}, {over.unit}</div>'
        f'<div style="height:12px;border-radius:3px;background:linear-gradient(to right,{stops})"></div>'
        '<div style="display:flex;justify-content:space-between">'
        f"<span>{over.low:.3g}</span><span>{middle:.3g}</span><span>{over.high:.3g}</span></div></div>"
    )
