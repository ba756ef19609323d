"""Days of the independent rod simulator that tests share, recorded once: `python -m tests.recorded_days` records what is missing.

A day is a measurement set as the simulator writes it, with the true effect beside it, in one archive under tests/data/days.
"""

from __future__ import annotations

import io
import json
import math
import sys
import tarfile
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, NamedTuple

import numpy as np

from tools.simulators.rod.bench import run
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.effects.backbone import BackboneAgeing
from tools.simulators.rod.effects.effect import Effect
from tools.simulators.rod.nuisance import built
from tools.simulators.rod.sensors import Noise
from tools.simulators.rod.write import write_set
from twin.measurements import Recording, read

FOLDER = Path(__file__).parent / "data/days"
TRUTH = "truth.json"
# Half of a day, with every kind of motion and all payloads: standard errors grow by half, some 1 % to 1.5 %.
HALF = {
    "slow_1", "slow_2", "slow_3", "fast_1", "fast_2", "wander_1", "wander_3", "steps_1", "hold_1", "hold_3", "circle_1", "circle_4",
    "heat_1", "heat_2", "heat_3", "turns_1", "turns_2", "turns_3",
}  # fmt: skip


@dataclass(frozen=True)
class Shakedown(BackboneAgeing):
    """The backbone tires in its first minutes only: compliance times 1 + 0.1 strength (1 - exp(-clock / 10 min))."""

    id: ClassVar[str] = "shakedown"

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray:
        return 1.0 - 0.1 * self.strength * np.expm1(-clock / 600.0)


class Day(NamedTuple):
    """What a day is made of: an effect at `strength` times its drawn size, a seed, a design, and whether it logs displacements."""

    effect: str | None
    strength: float = 2.0
    seed: int = 5
    design: str = "hanging"
    displacement: bool = False

    @property
    def file(self) -> Path:
        effect = "none" if self.effect is None else f"{self.effect}_{self.strength:g}"
        return FOLDER / f"{effect}_{self.design}_{self.seed}{'_displacement' * self.displacement}.tar.xz"

    def truth(self) -> Effect | None:
        """The true effect; its draw needs no simulation."""
        if self.effect is None:
            return None
        effects = all_effects() | {Shakedown.id: Shakedown}
        return replace(effects[self.effect].draw(np.random.default_rng([self.seed, 3])), strength=self.strength)

    def simulate(self, folder: Path) -> None:
        """Simulate the day and write it as a measurement set with its truth."""
        robot, motions, instruments = (np.random.default_rng([self.seed, n]) for n in range(3))
        plan, noise, truth = bench_day(self.design, motions), Noise.draw(instruments, coloured=False), self.truth()
        logs = run(built(robot), [] if truth is None else [truth], plan)
        write_set(
            folder, f"test day {self.seed}", plan, logs, noise, instruments,
            displacement=self.displacement or (truth is not None and truth.seen_in == "displacement"),
            ambient=truth is not None and truth.needs_ambient,
            exact_input=truth is not None and truth.logs_command,
        )  # fmt: skip
        (folder / TRUTH).write_text(_text(truth))

    def record(self) -> None:
        """Simulate the day and write its archive; the same day gives the same bytes."""
        FOLDER.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory() as folder:
            self.simulate(Path(folder))
            packed = io.BytesIO()
            with tarfile.open(fileobj=packed, mode="w:xz", format=tarfile.USTAR_FORMAT, preset=9) as archive:
                for file in sorted(Path(folder).iterdir()):
                    entry = tarfile.TarInfo(file.name)
                    entry.size = file.stat().st_size
                    archive.addfile(entry, io.BytesIO(file.read_bytes()))
        self.file.write_bytes(packed.getvalue())

    def unpack(self, folder: Path) -> None:
        """Write the recorded files into `folder`.

        Raises FileNotFoundError for a day that is not recorded, ValueError for one that was recorded with another true effect.
        """
        if not self.file.exists():
            raise FileNotFoundError(f"{self} is not recorded; add it to DAYS and run python -m tests.recorded_days")
        with tarfile.open(self.file) as archive:
            archive.extractall(folder, filter="data")
        if not same_truth(json.loads((folder / TRUTH).read_text()), json.loads(_text(self.truth()))):
            raise ValueError(f"{self.file} holds another effect than is drawn today; delete it and record it again")


@cache
def recorded_day(
    effect: str | None, strength: float = 2.0, seed: int = 5, design: str = "hanging", displacement: bool = False
) -> tuple[Recording, Effect | None]:
    """Return a day as it was recorded and its true effect."""
    day = Day(effect, strength, seed, design, displacement)
    with TemporaryDirectory() as folder:
        day.unpack(Path(folder))
        return replace(read(folder), folder=None), day.truth()


def half(recording: Recording) -> Recording:
    """Return the trials of `HALF`."""
    return recording.select([t.label for t in recording.trials if t.label in HALF])


def same_truth(a: object, b: object) -> bool:
    """Whether two truths agree; numbers to 1e-9, as another processor draws them."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same_truth(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(same_truth, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)
    return a == b


def _text(truth: Effect | None) -> str:
    told = {} if truth is None else {"effect": truth.id, **asdict(truth)}
    return json.dumps(told, indent=1, default=lambda array: array.tolist()) + "\n"


def main() -> None:
    for day in DAYS:
        if not day.file.exists():
            print(day, file=sys.stderr)
            day.record()
    for file in set(FOLDER.glob("*.tar.xz")) - {day.file for day in DAYS}:
        print(f"no test asks for {file.name}; delete it", file=sys.stderr)


RECOVERED = (  # an effect's own day, strong enough to be measured well, driven by what shows it
    Day("actuator_gain", 3.0, design="by_length"), Day("drive_zero", 4.0, design="by_length"),
    Day("actuator_lag"), Day("actuator_saturation", 3.5), Day("actuator_saturation", 3.5, design="by_length"),
    Day("backbone_ageing"), Day("backbone_creep"), Day("backbone_precurvature"), Day("backbone_precurvature", design="by_current"),
    Day("base_tilt", 4.0), Day("camera_misalignment"), Day("contact", 1.6), Day("load_cell_bias", 4.0),
    Day("load_cell_crosstalk", 1.0), Day("load_cell_drift", 3.0), Day("load_cell_gain"), Day("sma_cooling", design="by_current"),
    Day("sma_hysteresis", design="by_current"), Day("stiffness_asymmetry"), Day("stiffness_gradient"), Day("temperature_softening"),
    Day("tendon_backlash", 4.0), Day("tendon_elasticity"), Day("tendon_elasticity", design="by_length"), Day("tendon_friction"),
    Day("tendon_routing"), Day("time_delay", 0.8), Day("tip_payload", 4.0), Day("transmission_error", 4.0, design="by_length"),
)  # fmt: skip
DAYS = (
    *RECOVERED,
    Day(None), Day(None, seed=6), Day("tendon_backlash", 4.0, seed=7), Day("shakedown"),
    Day("tendon_friction", 2.5), Day("tendon_friction", 3.0, seed=6), Day("tendon_friction", design="sideways", displacement=True),
    Day("backbone_creep", 4.0), Day("load_cell_drift", 4.0), Day("time_delay", 8.0),
    # what no law of the catalogue says
    Day("clamp_slip"), Day("helix", 3.0), Day("soft_spot"), Day("vibration"),
    # without repeated trials
    *(Day(effect, size, 6, "no_repeats") for effect, size in (
        (None, 3.0), ("backbone_creep", 3.0), ("base_tilt", 4.0), ("contact", 1.6), ("magnet", 1.0),
    )),
    # loads that depend on the pose, and others
    *(Day(effect, size, 11, "default") for effect, size in (
        ("magnet", 2.0), ("magnet", 4.0), (None, 0.0), ("helix", 2.0), ("soft_spot", 2.0), ("tip_payload", 4.0),
    )),
)  # fmt: skip


if __name__ == "__main__":
    main()
