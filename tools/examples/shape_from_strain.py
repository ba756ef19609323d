"""The shape of a silicone finger from its four strain sensors: points with their standard deviation, for every row of a log."""

import numpy as np

import twin
from twin.shape.estimators.estimator import estimator_class
from twin.shape.predict import predict_shapes


def main(trials: int = 2) -> None:
    # %% A simulated session whose sensors drift; `twin align` would fit the twin to a built finger first.
    recording = twin.read(twin.sample("drift"), least_trials=1).select(range(trials))
    finger = twin.Twin.of_recording(recording)

    # %% `modal`: a network onto deformation modes, trained on the twin; `physics`: the twin's own equilibrium.
    arrays, notices = predict_shapes(recording, estimator_class("modal")(finger))
    for notice in notices:
        print("note:", notice)

    # %% NAME_vertices (n, P, 3) m in the base frame, NAME_std (n, P) m, NAME_cloud (n, M, 3) m.
    for trial in recording.trials:
        points, std = arrays[f"{trial.label}_vertices"], arrays[f"{trial.label}_std"]
        travel = 1e3 * np.ptp(points, axis=0).max()
        print(f"{trial.label}: {points.shape[1]} points move by up to {travel:.1f} mm, known to {1e3 * std.mean():.2f} mm")


if __name__ == "__main__":
    main()
