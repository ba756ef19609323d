"""Inverse kinematics with friction: which tensions bring the tip to a point, and what the history of pulls changes."""

import numpy as np

import twin
from twin.prediction.kinematics import LoadedRobot, inverse


def main() -> float:
    # %% A backbone whose tendons rub, slack at first.
    rubbing = twin.Twin.load("continuum").with_effect(twin.effects.TendonFriction(mu=0.2))
    robot = LoadedRobot(rubbing)
    print(f"straight, the tip is at {np.round(1e3 * robot.shape().tip, 1)} mm")

    # %% Lead it around a circle; each solution starts from the tensions and the slip before.
    worst, tension = 0.0, np.zeros(robot.n_tendon)
    for angle in np.linspace(0.0, 1.75 * np.pi, 8):
        wanted = robot.length * np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.93])
        found = inverse(robot, wanted, limit=6.0, within=3e-3)
        tension, worst = found.tension, max(worst, found.distance)
        robot.pull(tension)
        print(f"{np.degrees(angle):4.0f} deg: {np.round(tension, 2)} N, {1e3 * found.distance:.2f} mm from the point")

    # %% The same tensions from slack lead elsewhere: friction remembers.
    after = robot.shape().tip
    robot.rest()
    robot.pull(tension)
    print(f"pulled at once the tip is {1e3 * np.linalg.norm(robot.shape().tip - after):.1f} mm off")
    return worst


if __name__ == "__main__":
    main()
