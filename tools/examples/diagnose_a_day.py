"""The whole loop: read a day's log, find what the twin lacks, save the report, predict with the better twin."""

# %% A measurement set is a folder: measurements.toml and one CSV a trial.
from pathlib import Path

import numpy as np

import twin


def main(out: Path = Path("report"), day: Path | None = None) -> None:
    # %% Read it. What looks odd is said, nothing is repaired.
    recording = twin.read(day or twin.sample("friday"))
    print(recording.title, "from", recording.source)

    # %% Diagnose: calibrate the robot's own numbers, then look for a missing effect.
    found = twin.diagnose(recording)
    print(found.summary())

    # %% Keep it: report.html to read, report.json for programs, twin.toml to go on with.
    found.save(out)
    better = twin.Twin.load(out)

    # %% Predict: the same trials, as the better twin sees them.
    predicted = better.predict(recording)
    for measured, simulated in zip(recording.trials[:3], predicted.trials[:3], strict=True):
        error = 1e3 * np.nanmean(np.abs(measured.values["disk_8_x"] - simulated.values["disk_8_x"]))
        print(f"{measured.name}: x of the last disk is {error:.2f} mm off in the mean")


if __name__ == "__main__":
    main()
