"""The tip of a spring-driven robot along paths, under loads, by several controllers. Prints a Markdown table.

    python -m tools.benchmarks.control.tracking                      # paths x loads x controllers
    python -m tools.benchmarks.control.tracking --disturbed          # a payload, or a draught, in mid-path

The plant is a twin with effects its controllers do not know: other friction, other cooling, a wider and shifted loop, a softer body
that bends unequally, load cells off by per cents, noise, and a payload that nobody declares. Simulated, not hardware.
All but "PI only" know where the path goes.
"""

from dataclasses import dataclass, replace

import numpy as np
import tyro

from tools.benchmarks.control.baselines import PITensionLoop
from twin.body import Loads
from twin.control import HeatingGuard, TensionLoop, TipController
from twin.control.tip_controller import PATH_LOOK_AHEAD, twin_springs
from twin.control.tip_paths import TipPath, tip_paths
from twin.effects import effect_class
from twin.prediction.kinematics import HeatedRobot
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin import Twin
from twin.robots import load

DOWNWARD_GRAVITY = np.array([0.0, 0.0, 9.81])
ROBOT_LENGTH, RADIUS = 0.12, 0.014  # m
LAP, SECONDS_TO_START, SETTLE = 120.0, 10.0, 20.0  # s: one lap; from rest to the path's start; there
DT = 0.05  # s
PAYLOADS = (0.0, 0.01, 0.02, 0.03)  # kg
KNOWN_TWIN = Twin(load("continuum"), {}, (effect_class("tendon_friction")({"mu": 0.1}, 3),))
DOUBTS = {"payload": 0.01}  # kg


def unknown(draught: float = 1.2) -> Twin:
    """The plant, none of whose numbers its controllers are told."""
    robot = load("continuum")
    nominal = {p.name: p.value for p in robot.parameters}
    off = {"backbone.youngs_modulus": 0.94, "tendons.radius": 1.01}
    effects = (
        effect_class("tendon_friction")({"mu": 0.14, "presliding": 5e-4}, 3),
        effect_class("sma_cooling")({"factor": draught, "share_1": 1.1}, 3),
        effect_class("sma_hysteresis")({"width": 5.0, "shift": -3.0, "plateau": 1.05}, 3),
        effect_class("stiffness_asymmetry")({"along": 0.02, "across": 0.02}, 3),
        effect_class("load_cell_gain")({"gain_1": 1.02, "gain_2": 0.985, "gain_3": 1.01}, 3),
    )
    return Twin(robot, {name: by * nominal[name] for name, by in off.items()}, effects)


class Bench:
    """A plant behind its instruments: voltages in, noisy load cells and displacements out, the true tip for the referee alone."""

    def __init__(self, twin: Twin, payload: float, seed: int = 0) -> None:
        self.robot = HeatedRobot(twin, Loads(DOWNWARD_GRAVITY, payload=payload))
        self.noise = np.random.default_rng(seed)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Load cells (n_tendon,) N, tendon displacements (n_tendon,) m."""
        shape = self.robot.shape()
        n = self.robot.n_tendon
        return shape.tension + 0.01 * self.noise.normal(size=n), shape.displacement + 2e-5 * self.noise.normal(size=n)

    def heat(self, voltage: np.ndarray, dt: float) -> None:
        self.robot.step(voltage / self.robot.actuation.spring["resistance"], dt)

    def blow(self, twin: Twin) -> None:
        """The air around the springs becomes another twin's."""
        self.robot.actuation = self.robot.actuation._replace(spring=twin_springs(twin).records)


def controller(kind: str) -> TipController:
    """`full`, `PI only` (with inverse kinematics), `no friction` (`full` told mu = 0), `no tip feedback`; told of no payload."""
    loads, guard = Loads(DOWNWARD_GRAVITY), HeatingGuard(twin_springs(KNOWN_TWIN), ROOM_TEMPERATURE)
    if kind == "PI only":
        return TipController(KNOWN_TWIN, loads, PITensionLoop(guard), reset=None)
    if kind == "no friction":
        return TipController(replace(KNOWN_TWIN, effects=()), loads, TensionLoop(guard), doubts=DOUBTS)
    if kind == "no tip feedback":
        return TipController(KNOWN_TWIN, loads, TensionLoop(guard), reset=None)
    return TipController(KNOWN_TWIN, loads, TensionLoop(guard), doubts=DOUBTS)


@dataclass(frozen=True)
class Run:
    """Times (n,) s from the lap's start, wanted and true tips (n, 3) m, true tensions (n, n_tendon) N and temperatures K."""

    time: np.ndarray
    wanted: np.ndarray
    tip: np.ndarray
    tension: np.ndarray
    temperature: np.ndarray
    voltage: np.ndarray

    @property
    def rms(self) -> float:
        """Of the tip's distance on the lap, m."""
        on = self.time >= 0.0
        return float(np.sqrt(np.mean(np.sum((self.tip - self.wanted)[on] ** 2, axis=1))))


def track(
    bench: Bench, drive: TipController | np.ndarray, path: TipPath, *, until: float = LAP, disturb: str = "", foresee: bool = True
) -> Run:
    """One lap, or the part of it `until` (s), by a controller or by voltages (n, n_tendon) noted before. `disturb`: a payload or a
    draught comes at half of it. With `foresee` the controller is told where the path goes."""
    start, rest = path(0.0), bench.robot.shape().tip
    times = np.arange(-SECONDS_TO_START - SETTLE, until, DT)
    rows = []

    def at(t: float) -> np.ndarray:
        return (
            path(min(t / LAP, 1.0))
            if t >= 0.0
            else rest + min(1.0, (t + SECONDS_TO_START + SETTLE) / SECONDS_TO_START) * (start - rest)
        )

    for k, t in enumerate(times):
        wanted = at(t)
        if disturb and k == np.searchsorted(times, 0.5 * LAP):
            if disturb == "payload":
                bench.robot.set_payload(bench.robot.load.payload + 0.02)
            else:
                bench.blow(unknown(2.0))
        if isinstance(drive, np.ndarray):
            voltage = drive[k]
        else:
            voltage = drive.step(wanted, *bench.read(), DT, ahead=at(t + PATH_LOOK_AHEAD) if foresee else None)
        bench.heat(voltage, DT)
        shape = bench.robot.shape()
        rows.append((t, wanted, shape.tip, bench.robot.tension, bench.robot.spring_temperature.copy(), voltage))
    return Run(*(np.array(column) for column in zip(*rows, strict=True)))


CONTROLLERS = ("full", "PI only", "open loop", "no friction", "no tip feedback")


def attempt(kind: str, name: str, payload: float, disturb: str = "", until: float = LAP) -> Run:
    """One run of the table. Open loop: the voltages that follow the path on the robot as it is known, unloaded, played back."""
    path = tip_paths(ROBOT_LENGTH, RADIUS)[name]
    if kind == "open loop":
        foreseen = track(Bench(KNOWN_TWIN, 0.0, seed=1), controller("no tip feedback"), path, until=until).voltage
        return track(Bench(unknown(), payload), foreseen, path, until=until, disturb=disturb)
    return track(Bench(unknown(), payload), controller(kind), path, until=until, disturb=disturb, foresee=kind != "PI only")


def main(disturbed: bool = False) -> None:
    """Print RMS tip errors by path and load, or with a payload or a draught that comes in mid-path."""
    cases = [(n, p, "") for n in tip_paths(ROBOT_LENGTH, RADIUS) for p in PAYLOADS]
    if disturbed:
        cases = [(n, 0.01, d) for n in ("circle", "figure of eight") for d in ("payload", "draught")]
    print(f"| RMS tip error, mm | {'comes in mid-path' if disturbed else 'payload'} | {' | '.join(CONTROLLERS)} |")
    print("|---|---|" + "---|" * len(CONTROLLERS), flush=True)
    hottest = 0.0
    for name, payload, disturb in cases:
        runs = [attempt(kind, name, payload, disturb) for kind in CONTROLLERS]
        hottest = max(hottest, float(runs[0].temperature.max()))
        what = {"payload": "20 g more", "draught": "loss 1.2 -> 2.0"}.get(disturb, f"{1e3 * payload:g} g")
        print(f"| {name} | {what} | {' | '.join(f'{1e3 * r.rms:.2f}' for r in runs)} |", flush=True)
    print(f"\nhottest spring under the full controller: {hottest - 273.15:.0f} degC")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
