"""A twin's own rollouts are diagnosed as what they are, in small; whole: `tools.benchmarks.diagnosis.days.own_rollouts`."""

from __future__ import annotations

import pytest

from tools.benchmarks.diagnosis.days.own_rollouts import Case, cases, right, run, table


def test_every_robot_is_rolled_out_by_each_of_its_drives() -> None:
    found = {(c.robot, c.drive) for c in cases()}
    assert ("continuum", "tension") in found
    assert ("continuum", "displacement") in found
    assert ("tendon_leg", "control") in found
    assert ("two_link", "displacement") not in found  # its tendons are driven by tension


@pytest.mark.parametrize("effect", ["none", "lag", "payload"])
def test_a_rollout_in_statics_is_told_as_what_it_is(effect: str) -> None:
    """A payload of 20 g, 11 sigma, takes the links' own numbers to their bounds before it is looked for."""
    row = run(Case("two_link", "tension", 10.0, effect), seed=47000)
    assert row["verdict"] == ("noise" if effect == "none" else "explained")
    assert right(row)
    assert ("| 0/1 0 % | 0/0 |" if effect == "none" else "| 0/0 | 1/1 100 % |") in table([row])
