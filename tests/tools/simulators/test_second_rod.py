"""The second bench: its rod, tendons and contact against closed forms and differences, its days read back as the contract says."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import spence

from tools.benchmarks.diagnosis.days.second_bench_days import exact, totals, true_row
from tools.simulators.second_rod import write
from tools.simulators.second_rod.day import draw_day
from tools.simulators.second_rod.effects import CATALOGUE_KINDS, EFFECT_KINDS, ODD_KINDS, Effect
from tools.simulators.second_rod.loom import Loom
from tools.simulators.second_rod.mechanics.contact import POST_OBSTACLE, WALL_OBSTACLE, obstacle
from tools.simulators.second_rod.mechanics.equilibrium import Equilibrium, Loads, Model, Problem, empty_memory, residual
from tools.simulators.second_rod.mechanics.fields import Magnet
from tools.simulators.second_rod.mechanics.rod import INTERVALS, PIECES_PER_INTERVAL, shape
from tools.simulators.second_rod.mechanics.simulate import simulate, without_effects
from tools.simulators.second_rod.mechanics.tendons import SLACK_ROUNDING, segments, tension_of_stretch, tensions
from tools.simulators.second_rod.plan import DAYS_PER_PLAN, Planned, plan
from tools.simulators.second_rod.robot import (
    BACKBONE_MASS,
    BACKBONE_RADIUS,
    DISK_MASS,
    HOLE_RADIUS,
    ROD_LENGTH,
    YOUNGS_MODULUS,
    Robot,
)
from twin.measurements import read

BENDING = YOUNGS_MODULUS * np.pi * BACKBONE_RADIUS**4 / 4  # N m^2
WEIGHTLESS, HANGING = np.zeros(3), np.array([0.0, 0.0, 9.81])
INTERVAL = ROD_LENGTH / INTERVALS


def at_rest(robot: Robot, drive: list[float], gravity: np.ndarray, payload: float = 0.0, functions: int = 7) -> Equilibrium:
    found = Equilibrium(robot.model(by_displacement=False, functions=functions))
    found.start(Loads(np.array(drive), gravity, payload), 1.0, 6)
    assert found.failures == 0
    return found


@pytest.mark.parametrize("tension", [1.0, 3.0])
def test_a_single_tendon_without_weight_bends_to_an_arc(tension: float) -> None:
    """Each interval bends by the b that makes E I b^2 / 2 l + T chord(b) stationary, chord = 2 sin(b / 2) (l / b - r)."""

    def stationary(b: float) -> float:
        slope = np.cos(b / 2) * (INTERVAL / b - HOLE_RADIUS) - 2 * np.sin(b / 2) * INTERVAL / b**2
        return BENDING * b / INTERVAL + tension * slope

    curvature = float(brentq(stationary, 1e-3, 1.5)) / INTERVAL  # type: ignore[arg-type]
    angles = curvature * INTERVAL * np.arange(1, INTERVALS + 1)
    arc = np.column_stack([1 - np.cos(angles), 0 * angles, np.sin(angles)]) / curvature
    centres, axes = at_rest(Robot(disk_mass=0.0, backbone_mass=0.0), [tension, 0.0, 0.0], WEIGHTLESS).disks()
    # Simpson's rule over half an interval of up to 0.35 rad: some um, a fiftieth of a marker's noise
    np.testing.assert_allclose(centres, arc, atol=5e-6)
    # the same over the 15 mm of an interval
    np.testing.assert_allclose(axes, np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)]), atol=4e-4)


def test_a_weak_sideways_weight_bends_it_as_a_beam() -> None:
    """w L^4 / 8 E I for the backbone and m g a^2 (3 L - a) / 6 E I for each disk, small deflection."""
    gravity = 0.02 * 9.81
    arms = INTERVAL * np.arange(1, INTERVALS + 1)
    backbone = BACKBONE_MASS * gravity * ROD_LENGTH**3 / (8 * BENDING)
    disks = DISK_MASS * gravity * np.sum(arms**2 * (3 * ROD_LENGTH - arms)) / (6 * BENDING)
    tip = at_rest(Robot(), [0.0, 0.0, 0.0], np.array([gravity, 0.0, 0.0])).disks()[0][-1]
    # masses in points twice an interval and curvature at the middle of a quarter: (1 / 32)^2 = 0.1 %
    assert tip[0] == pytest.approx(backbone + disks, rel=1e-3)


def energy(coefficients: np.ndarray, rest: np.ndarray, drive: np.ndarray, gravity: np.ndarray, model: Model) -> float:
    """Everything conservative at once, written from the definitions: bending, weight, tendons, wall, magnet, held sliders; J."""
    rod = model.rod
    rotations, positions, curvatures, _ = shape(coefficients, rod)
    strain = curvatures - rod.basis @ rest.reshape(3, -1).T / rod.length
    xx, xy, yy = rod.bending.T
    density = xx * strain[:, 0] ** 2 + 2 * xy * strain[:, 0] * strain[:, 1] + yy * strain[:, 1] ** 2
    density += rod.twisting * strain[:, 2] ** 2
    total = 0.5 * np.sum(rod.steps * density) - np.sum(rod.masses[:, None] * positions @ gravity)
    total -= np.sum(model.disk_masses * (positions[PIECES_PER_INTERVAL::PIECES_PER_INTERVAL] @ gravity))
    mass, lever = model.outboard
    total -= mass * (positions[-1] + lever * rotations[-1, :, 2]) @ gravity + model.loom.mass * positions[-1] @ gravity
    stretches = segments(rotations, positions, model.tendons.holes)[1].sum(1) - model.tendons.rest_lengths + drive
    for stretch in stretches:
        total += quad(tension_of_stretch, -0.02, stretch, args=(model.tendons,), points=[0.0], epsabs=1e-13, limit=200)[0]
    wall = model.obstacle
    depth = (
        wall.clearance - (positions[PIECES_PER_INTERVAL :: PIECES_PER_INTERVAL // 2] - wall.point) @ wall.direction
    ) / wall.rounding
    total += wall.hardness * wall.rounding**2 * np.sum(-spence(1 + np.exp(depth)))  # softplus integrates to -Li2(-exp x)
    square = np.sum((positions[-1] - model.magnet.place) ** 2)
    total += model.magnet.energy * model.magnet.core**6 / (square + model.magnet.core**2) ** 3
    straight = np.array([0, 0, rod.length])
    return float(total + 0.5 * np.sum(model.loom.stiffnesses) * np.sum((positions[-1] - straight) ** 2))


def test_the_residual_is_the_gradient_of_the_energy() -> None:
    random = np.random.default_rng(0)
    robot = Robot(
        compliance=1e-4,
        stiffening=200.0,
        asymmetry=(0.2, 0.4),
        outboard=(2e-3, 5e-3),
        obstacle=obstacle(WALL_OBSTACLE, np.array([0.02, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))._replace(
            hardness=50.0, rounding=2e-3
        ),
        magnet=Magnet(np.array([0.03, 0.01, 0.1]), 1e-3, 0.025),
        loom=Loom(np.array([0.9, 0.5, 0.25]), np.full(3, 1e3), 1e-3),
    )
    model = robot.model(by_displacement=True)
    size = model.rod.basis.size // len(model.rod.basis) * 3
    coefficients, rest = random.normal(0, 0.2, size), random.normal(0, 0.1, size)
    loads = Loads(np.array([8e-3, 3e-3, -2e-3]), np.array([3.0, -2.0, 9.0]), 0.0)
    memory = empty_memory()
    memory.anchors[:, 2] = model.rod.length
    found, _ = residual(coefficients, Problem(model, rest, 1.0, loads, memory), empty_memory())
    outside = (rest, loads.drive, loads.gravity, model)
    slopes = [(energy(coefficients + d, *outside) - energy(coefficients - d, *outside)) / 2e-5 for d in 1e-5 * np.eye(size)]
    # central differences: step^2 = 1e-10 of the third derivative, and 1e-13 J of the integrals over 2e-5
    np.testing.assert_allclose(found, slopes, atol=1e-6 * float(np.max(np.abs(slopes))))


@pytest.mark.parametrize("touching", [False, True])
def test_more_polynomials_move_no_marker(touching: bool) -> None:
    post = obstacle(POST_OBSTACLE, np.array([0.03, 0.0, 0.07]), np.array([0.0, 0.95, 0.3122]) / np.hypot(0.95, 0.3122), 7e-3)
    robot = replace(Robot(), obstacle=post) if touching else Robot()
    seven, ten = (at_rest(robot, [2.5, 1.2, 0.1], np.array([0.0, 9.81, 0.0]), 10e-3, n).disks()[0] for n in (7, 10))
    # a fiftieth of the noise of a marker, so that it shows in no residual
    assert np.max(np.linalg.norm(seven - ten, axis=1)) < (8e-6 if touching else 6e-6) + 1e-6


def test_friction_along_a_held_arc_is_eulers() -> None:
    """T = T_0 exp(-mu (sum of angles + holes theta_0)): half a bend at the base hole, a whole one at each disk but the last."""
    model = Robot(friction=0.2, least_wrap=0.01, sliding_length=3e-5).model(by_displacement=False)
    bend = 0.1
    coefficients = np.zeros(3 * model.rod.basis.shape[1])
    coefficients[model.rod.basis.shape[1]] = INTERVALS * bend
    rotations, positions, _, _ = shape(coefficients, model.rod)
    directions, lengths = segments(rotations, positions, model.tendons.holes)
    before, after, drive = empty_memory(), empty_memory(), np.array([2.0, 1.0, 1.0])
    before.beyond[:] = 1.0  # m: pulled in by far more than the sliding length
    along, base = tensions(directions, lengths, drive, model.tendons, before, after)
    wraps = bend * np.arange(0.5, INTERVALS) + 0.01 * np.arange(1, INTERVALS + 1)
    assert base[0] == 2.0
    # the tendon in the plane of bending; only rounding is left (positions by Simpson: 1e-7 of a direction)
    np.testing.assert_allclose(along[0], 2.0 * np.exp(-0.2 * wraps), rtol=1e-6)


def test_friction_is_mobilised_with_travel_and_stands_still() -> None:
    model = Robot(friction=0.2, sliding_length=3e-5).model(by_displacement=False)
    at = Equilibrium(model)
    at.start(Loads(np.array([0.5, 0.1, 0.1]), HANGING, 0.0), 1.0, 12)
    for tension in np.linspace(0.5, 2.0, 20):
        at.step(Loads(np.array([tension, 0.1, 0.1]), HANGING, 0.0), 1.0)
    assert np.all(at.memory.mobilised[0] > 0.999)  # 12 mm of travel through the first hole, 1 mm through the last, over 0.03 mm
    held, before = at.memory.mobilised.copy(), at.disks()[0]
    for _ in range(50):
        at.step(Loads(np.array([2.0, 0.1, 0.1]), HANGING, 0.0), 1.0)
    # travel at rest is what Newton leaves, 1e-6 rad times 8 mm, and below the rounding of a reversal it counts squared
    np.testing.assert_allclose(at.memory.mobilised, held, atol=1e-3)
    np.testing.assert_allclose(at.disks()[0], before, atol=1e-6)


def test_displacement_and_tension_drives_invert_each_other() -> None:
    drive = np.array([2.0, 1.0, 0.2])
    pulled = at_rest(Robot(), list(drive), HANGING)
    robot = Robot()
    stretch = robot.compliance * (drive - SLACK_ROUNDING**2 / (4 * drive))  # the rounded law solved for the stretch
    back = Equilibrium(robot.model(by_displacement=True))
    back.start(Loads(pulled.pulled_in() + stretch, HANGING, 0.0), 1.0, 12)
    # Newton ends at 2e-9 N m over a lever of 8 mm: below a uN; a stretch to 1e-10 m over the compliance: 0.03 mN
    np.testing.assert_allclose(back.tensions, drive, atol=5e-5)
    np.testing.assert_allclose(back.disks()[0], pulled.disks()[0], atol=1e-6)


def test_a_wall_keeps_the_rims_out() -> None:
    free = at_rest(Robot(), [2.0, 0.1, 0.1], HANGING).disks()[0]
    wall = obstacle(WALL_OBSTACLE, np.array([0.04, 0.0, 0.06]), np.array([-1.0, 0.0, 0.0]))
    stopped = at_rest(Robot(obstacle=wall), [2.0, 0.1, 0.1], HANGING).disks()[0]
    assert free[-1, 0] > 0.05
    # 3 kN/m and a force of the order of EI / L^2 = 0.1 N: less than 0.2 mm into a wall 40 mm away, rims of 9 mm
    assert np.max(stopped[:, 0]) == pytest.approx(0.031, abs=2e-4)


def test_every_thirty_days_have_their_proportions_and_all_kinds_come_up() -> None:
    days = plan(2 * DAYS_PER_PLAN, 3)
    for block in (days[:DAYS_PER_PLAN], days[DAYS_PER_PLAN:]):
        odd = [day for day in block if set(day.kinds) & set(ODD_KINDS)]
        numbers = [len(day.kinds) for day in block if day not in odd]
        assert (numbers.count(0), numbers.count(1), numbers.count(2), len(odd)) == (4, 16, 5, 5)
        assert {kind for day in block for kind in day.kinds} >= set(CATALOGUE_KINDS)
    assert all(day.drive in EFFECT_KINDS[kind].drives for day in days for kind in day.kinds)
    assert plan(7, 3) == days[:7]


def test_it_imports_nothing_of_what_it_is_to_check() -> None:
    for path in Path(write.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not [name for name in names if name.startswith(("twin", "tools.simulators.rod"))], path


SMALL = Planned(1, "tension", ("precurvature",), (3.0,), True)
SEED, TRIALS = 5, 3


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("second_bench")
    assert write.make_day(out, SMALL, SEED, TRIALS)
    return out


def test_a_day_is_read_back_with_its_truth(made: Path) -> None:
    recording = read(made / "sets" / "day_01")
    truth = json.loads((made / "truth" / "day_01.json").read_text())
    assert recording.robot == "continuum"
    assert len(recording.trials) == TRIALS
    assert [channel.name for channel in recording.inputs()] == [f"tendon_{i}_tension" for i in (1, 2, 3)]
    assert {"tendon_1_displacement", "disk_8_z"} <= {channel.name for channel in recording.outputs()}
    assert [effect["id"] for effect in truth["effects"]] == ["backbone_precurvature"]
    assert truth["effects"][0]["known"]
    row = true_row(recording.folder)
    assert (row["kind"], row["true"], row["drive"]) == ("one", ["backbone_precurvature"], truth["drive"])
    assert truth["effects"][0]["size"]["after_refit"] == pytest.approx(3.0, rel=0.12)  # sizing stops this near
    for trial in recording.trials:
        # the first marker cannot leave its interval: SI units and the base frame
        heights = trial.values["disk_1_z"]
        assert np.nanmax(np.abs(heights - INTERVAL)) < 5e-3


def test_the_same_seed_gives_the_same_files(made: Path, tmp_path: Path) -> None:
    write.make_day(tmp_path, SMALL, SEED, TRIALS)
    assert contents(tmp_path) == contents(made)
    other = tmp_path / "other"
    write.make_day(other, SMALL, SEED + 1, TRIALS)
    assert contents(other) != contents(made)


def test_a_killed_run_goes_on(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(path: Path, *_: object) -> None:
        path.write_text("half a ta")
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(write, "write_trial", killed)
        with pytest.raises(KeyboardInterrupt):
            write.make_day(tmp_path, SMALL, SEED, TRIALS)
    assert not (tmp_path / "sets").exists()
    assert write.make_day(tmp_path, SMALL, SEED, TRIALS)
    assert contents(tmp_path) == contents(made)
    assert write.make_day(tmp_path, SMALL, SEED, TRIALS) is None


def test_the_totals_count_effects_hardly_told_apart_as_one() -> None:
    def day(kind: str, true: list[str], verdict: str, *names: str) -> dict[str, Any]:
        return {"kind": kind, "true": true, "verdict": verdict, "claims": list(names), "after": float(len(names)), "floor": 0.5}

    assert exact(day("one", ["time_delay"], "explained", "actuator_lag"))
    assert not exact(day("one", ["time_delay"], "explained", "actuator_lag", "time_delay"))
    lines = totals(
        [
            day("none", [], "noise"),
            day("none", [], "unexplained"),
            day("one", ["base_tilt"], "explained", "camera_misalignment", "contact"),
            day("unknown", ["magnet"], "partly_explained", "contact"),
        ]
    )
    assert [line.split()[-1] for line in lines] == ["1/2", "1/1", "0/1", "0/0", "0/0", "1/1", "4.00"]
    pair = day("pair", ["contact", "base_tilt"], "explained", "contact")  # after 1.0 for 0.5; the other day 2.0
    assert totals([pair, day("one", ["contact"], "explained", "contact", "base_tilt")])[-1].endswith(" 3.00, 3.80")


@pytest.mark.parametrize("kind", sorted(EFFECT_KINDS))
def test_an_effect_moves_the_markers_more_when_larger(kind: str) -> None:
    law = EFFECT_KINDS[kind]
    random = np.random.default_rng(8)
    day = draw_day(random, sorted(law.drives)[-1], law.wants, trials=3)
    drawn = law.draw(random, day)
    assert json.loads(json.dumps(drawn.parameters()))
    rows = [np.arange(0, trial.times.size, 1 if law.remembers else 8) for trial in day.trials]

    def moved(effect: Effect) -> float:
        runs = simulate(day, [effect], rows)
        plain = without_effects(day, runs, rows)
        assert sum(run.failures for run in (*runs, *plain)) == 0
        return float(np.sqrt(np.mean([np.mean((a.positions - b.positions) ** 2) for a, b in zip(runs, plain, strict=True)])))

    largest = min(drawn.scale_limit(), 3.0)
    # half an effect may be one that does not touch yet; the whole must show against a noise of 0.25 mm
    assert moved(drawn.scaled(largest)) > max(1.1 * moved(drawn.scaled(largest / 2)), 0.05e-3)
