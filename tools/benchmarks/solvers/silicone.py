"""The finger's silicone law against public pull tests:  python -m tools.benchmarks.solvers.silicone FOLDER

FOLDER holds CSV files of L. Marechal's Soft-Robotics-Materials-Database (silicone-tensile of tools.benchmarks.hardware.fetch). An
incompressible neo-Hookean bar under engineering strain e, stretch a = 1 + e, carries the engineering stress

    s = E / 3 (a - 1 / a^2).

E is fitted (least squares) up to a strain, with the strain at which the grips had taken up the slack (cross-heads read it); the
law holds up to the largest strain to which no stress is off by more than `HOLDS` of the largest. A test is one specimen at a rate:
unloading, rate and batch are not in it.
"""

from pathlib import Path

import numpy as np
import tyro
from scipy.optimize import least_squares

from tools.benchmarks.table import markdown

STRAINS = (0.3, 1.0, 3.0)
HOLDS = 0.05


def pulled(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Engineering strains (n,) and stresses (n,) Pa of a test, up to its largest stress."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("Time (s);"))
    rows = np.array([[float(v) for v in line.split(";")] for line in lines[start + 1 :] if line.strip(";")])
    end = int(np.argmax(rows[:, 4])) + 1
    return rows[:end, 3], 1e6 * rows[:end, 4]


def neo_hookean(strain: np.ndarray) -> np.ndarray:
    """Engineering stress (n,) over Young's modulus of an incompressible bar."""
    return (1.0 + strain - (1.0 + strain) ** -2) / 3.0


def fitted(strain: np.ndarray, stress: np.ndarray, most: float) -> tuple[float, float, float]:
    """Young's modulus (Pa) fitted up to a strain, the slack, and the largest miss over the largest stress."""
    near = strain <= most + float(strain[0])
    e, s = strain[near], stress[near]

    def miss(x: np.ndarray) -> np.ndarray:
        return x[0] * neo_hookean(np.maximum(e - x[1], 0.0)) - s / s.max()

    found = least_squares(miss, [1.0, 0.0])
    return float(found.x[0] * s.max()), float(found.x[1]), float(np.abs(found.fun).max())


def holds(strain: np.ndarray, stress: np.ndarray) -> float:
    """The largest strain up to which the law is good to `HOLDS`."""
    good = [e for e in np.linspace(0.3, float(strain.max()), 60) if fitted(strain, stress, e)[2] < HOLDS]
    return float(max(good, default=0.0))


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print modulus, slack and range of every silicone in a folder."""
    heads = [f"E to {100 * e:.0f} % strain, kPa (miss)" for e in STRAINS]
    rows = []
    for path in sorted(folder.glob("*.csv")):
        test = pulled(path)
        found = [fitted(*test, e) for e in STRAINS]
        moduli = [f"{1e-3 * E:.0f} ({100 * miss:.0f} %)" for E, _, miss in found]
        rows.append((path.stem, *moduli, f"{100 * found[0][1]:.1f}", f"{100 * holds(*test):.0f} %"))
    print(markdown(("silicone", *heads, "slack, %", f"law good to {100 * HOLDS:.0f} % up to"), rows))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
