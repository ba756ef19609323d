"""A diagnosis made by hand, without any solver: its marker error is a known loop, so every section has something to show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin import robots
from twin.body import Drive, Loads
from twin.diagnosis import Claim, Diagnosis, Errors, Settings
from twin.diagnosis.checks.identifiability import Visibility
from twin.diagnosis.checks.loops import Loop, Loops
from twin.diagnosis.checks.suspicions import Suspicion
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.next_experiment import Experiment
from twin.diagnosis.noise.model import Noise
from twin.effects import effect_class
from twin.foundation.parameters import FittedValue
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import ROOM_TEMPERATURE, Inputs, prepare
from twin.prediction.twin import Twin

LOOP = 2e-3  # m: half width of the loop that tendon 2 leaves in disk_8_x
SIGMA = 2.5e-4  # m
SETTINGS = Settings(seed=3, jobs=1)


PULL = Inputs(
    "pull",
    np.zeros(1),
    np.zeros(1),
    np.zeros((1, 3)),
    (Drive.TENSION,) * 3,
    np.full(1, ROOM_TEMPERATURE),
    Loads(np.array([0, 0, 9.81])),
)
EXPERIMENT = Experiment("pull tendon 3 to 2.0 N and release it", PULL, 10.0, 3, (("tendon_friction",), ("backbone_creep",)))


def recording(
    *, title: str = "Bench test", trial: str = "circle", n: int = 60, displacement: bool = False, markers: bool = True
) -> Recording:
    """Five trials in which tendon 2 is pulled and released while the others rest; two carry a payload."""
    t = np.linspace(0.0, 30.0, n)
    pull = 2.0 * np.sin(np.pi * t / 30.0) ** 2
    channels = [Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3)]
    channels += [Channel(f"disk_{k}_{a}", "output", "mm", SIGMA) for k in range(1, 9) for a in "xyz"] if markers else []
    channels += [Channel(f"tendon_{i}_displacement", "output", "mm") for i in (1, 2, 3)] if displacement else []
    trials = []
    for k in range(5):
        values = {c.name: np.zeros(n) for c in channels}
        values["tendon_2_tension"] = (1.0 + 0.1 * k) * pull
        values["tendon_1_tension"] = np.full(n, 0.05)
        for j in range(1, 9) if markers else ():
            values[f"disk_{j}_x"] = 5e-3 * j * pull
            values[f"disk_{j}_z"] = np.full(n, 0.015 * j)
        loads = {"tip_payload": 0.01} if k > 2 else {}
        trials.append(Trial(f"{trial}_{k}.csv", t, values, loads, start=100.0 * k))
    return Recording("continuum", title, "hardware: by hand", np.array([0, 0, 9.81]), tuple(channels), tuple(trials))


def diagnosis(verdict: str = "explained", of: Recording | None = None, **changes: object) -> Diagnosis:
    """A diagnosis with this verdict; `changes` replace fields."""
    of = of or recording()
    robot = robots.load("continuum")
    bench = prepare(of, robot)
    rng = np.random.default_rng(0)
    column = next((j for j, o in enumerate(bench.outputs) if o.channel.name == "disk_8_x"), 0)
    nominal, calibrated, after = [], [], []
    for y, i in zip(bench.measured, bench.inputs, strict=True):
        side = np.sign(np.gradient(i.command[:, 1], i.time))
        noisy = y + rng.normal(0, SIGMA, y.shape)
        loop = np.zeros_like(y)
        loop[:, column] = LOOP * side * i.command[:, 1] / 2.0
        after.append(noisy)
        calibrated.append(noisy + loop)
        nominal.append(noisy + 2.0 * loop)
    found = verdict in ("explained", "partly_explained")
    friction = Claim(
        "tendon_friction", {"mu": FittedValue(0.103, 0.0013, "1"), "presliding": FittedValue(6e-4, 2e-5, "m")}, 7.8e-4, 0.99, 0.53
    )
    creep = Claim(
        "backbone_creep", {"amplitude": FittedValue(0.04, 0.001, "1"), "time": FittedValue(12.0, float("nan"), "s")}, 7.6e-4, 0.006
    )
    small = Claim("time_delay", {"delay": FittedValue(0.01, 0.004, "s")}, float("nan"), 0.0, 0.03)
    values = {"backbone.youngs_modulus": 7.6e10, "disks.mass": 5.02e-3}
    groups = list(dict.fromkeys(o.group for o in bench.outputs))
    last = 4.9e-4 if found else 7.8e-4
    made = Diagnosis(
        verdict=verdict,
        twin=Twin(robot, values, (effect_class("tendon_friction")({"mu": 0.103, "presliding": 6e-4}),) if found else ()),
        calibrated=Twin(robot, values),
        claims=(friction,) if found else (),
        runners_up=(creep,),
        below_materiality=(small,),
        parameters={"backbone.youngs_modulus": FittedValue(7.6e10, 2e8, "Pa"), "disks.mass": FittedValue(5.02e-3, 1.4e-4, "kg")},
        unfixed=("disks.mass",),
        correlation=(("backbone.youngs_modulus", "tendon_friction.mu"), np.array([[1.0, -0.8], [-0.8, 1.0]])),
        errors=Errors(
            nominal=dict.fromkeys(groups, 1.06e-3),
            calibrated=dict.fromkeys(groups, 7.8e-4),
            after=dict.fromkeys(groups, last),
            floor=dict.fromkeys(groups, 4.4e-4),
            ci_calibrated=dict.fromkeys(groups, (6.9e-4, 8.8e-4)),
            ci_after=dict.fromkeys(groups, (last - 1e-5, last + 1e-5)),
        ),
        noise=Noise(
            np.full(len(bench.outputs), SIGMA), np.full(3, 0.01), np.zeros(len(bench.outputs)), "2 pairs of repeated trials"
        ),
        structure_before=0.42,
        structure_after=0.21 if verdict == "partly_explained" else 0.02,
        structure_unseen=0.05,
        limits=AcceptanceLimits(),
        structure={"static": 0.01, "direction": 0.2, "rate": 0.0},
        strongest=(("direction of T2", 0.2), ("T1 T2", 0.01)),
        line=(2.0, 0.1),
        worst_channel="disk_8_x",
        description="A smooth part is left.",
        caveats=(),
        identifiability=(
            Visibility("tendon_friction", 0.1, 0.1, 0.8, "backbone_creep", ("mu", 0.004, "1"), ()),
            Visibility("time_delay", 0.1, 0.3, 0.06, "actuator_lag", ("delay", 0.01, "s"), ("two rates of pull, ten times apart",)),
            Visibility(
                "tendon_elasticity", np.inf, np.inf, 0.0, "", ("stretch", np.inf, "m/N"), ("tendon displacements",), "stretch"
            ),
        ),
        ambiguous=(("tendon_routing", "time_delay"),) if found else (),
        experiment=EXPERIMENT if verdict != "noise" else None,
        recording=of,
        prepared=bench,
        fitted_trials=(0, 1, 3),
        held_out_trials=(2, 4),
        folds=(),
        loops=Loops("marker", "disk_8", (Loop(0, LOOP, 2e-5, 40, 0.0), Loop(1, LOOP, 2e-5, 40, 0.0))),
        suspicions=(Suspicion("sign", "tendon_1_displacement falls", "the other sign"),),
        predictions={"nominal": nominal, "calibrated": calibrated, "after": after if found else calibrated},
        notices=("a notice", "a notice"),
        settings=SETTINGS,
    )
    return replace(made, **changes)
