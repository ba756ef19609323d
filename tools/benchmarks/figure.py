"""Pictures for pages, as SVG files that come out the same each time. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

FIGURES = Path(__file__).parents[1] / "figures"


def axes(columns: int, size: tuple[float, float], font: float = 9.0, **options: Any) -> tuple[Any, Any]:
    """Return a figure of a row of axes, and these."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": font, "axes.spines.top": False, "axes.spines.right": False, "svg.hashsalt": "twin"})
    return plt.subplots(1, columns, figsize=size, layout="constrained", **options)


def save(figure: Any, path: Path) -> None:
    """Write a figure and print where it is."""
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, metadata={"Date": None})
    print(path)
