"""The fit of the silicone law to pull tests, on a bar whose stress is known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.solvers.silicone import fitted, holds, neo_hookean, pulled

SLACK, E = 0.03, 60e3


def test_a_bar_gives_back_its_modulus_and_its_slack(tmp_path: Path) -> None:
    """Written as a test machine does, in MPa with a header; to the six digits written."""
    strain = np.linspace(0.0, 2.0, 400)
    stress = E * neo_hookean(np.maximum(strain - SLACK, 0.0))
    rows = [f"{i};0;0;{e:.6f};{s * 1e-6:.9f}" for i, (e, s) in enumerate(zip(strain, stress, strict=True))]
    path = tmp_path / "bar.csv"
    path.write_text(
        "\n".join(["PARAMETER;INFO", "", "Time (s);True Strain;True Stress (MPa);e;s", *rows, f"400;0;0;2.1;{stress[9]}"])
    )
    modulus, slack, miss = fitted(*pulled(path), 1.0)
    assert modulus == pytest.approx(E, rel=1e-4)
    assert slack == pytest.approx(SLACK, abs=1e-5)
    assert miss < 1e-5


def test_a_bar_that_stiffens_is_no_neo_hookean() -> None:
    """A limit of stretch a tenth beyond the last (Gent 1996) doubles the stress there; the law is good to part of the way only."""
    strain = np.linspace(0.0, 2.0, 400)
    stretch = 1.0 + strain
    invariant = stretch**2 + 2.0 / stretch - 3.0
    stress = E * neo_hookean(strain) / (1.0 - invariant / (1.1 * invariant[-1]))
    assert 0.3 < holds(strain, stress) < 1.5
    assert holds(strain, E * neo_hookean(strain)) == strain[-1]
