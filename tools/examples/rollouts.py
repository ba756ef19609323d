"""What a better twin does under drawn commands: rollouts in parallel, kept as a measurement set that can be diagnosed again."""

from pathlib import Path

import twin
from twin.prediction.rollout import Drawing, draw_controls


def main(out: Path = Path("rolled"), n: int = 20) -> None:
    # %% A twin with friction; after a diagnosis it is `twin.Twin.load("report")`.
    rubbing = twin.Twin.load("continuum").with_effect(twin.effects.TendonFriction(mu=0.2))

    # %% Controls: from slack, eased moves from bend to bend, drawn from a seed.
    controls = draw_controls(rubbing, n, seed=1, drawing=Drawing(seconds=4.0, rate=50.0))

    # %% MuJoCo steps each rollout; noise is added to the markers.
    rolled = twin.rollout(rubbing, controls, noise=2e-4, seed=1, jobs=2)
    print(f"{len(rolled.recording.trials)} rollouts, {len(rolled.lost)} ended early; {rolled.recording.source}")

    # %% The same format as a log from a bench: `twin view`, `twin evaluate` and `twin diagnose` take it.
    twin.write(rolled.recording, out)
    print(f"written to {out}: {twin.read(out).n_samples} samples")


if __name__ == "__main__":
    main()
