"""A robot of your own: a folder with a robot.toml, begun from a starter, changed, and bent."""

from pathlib import Path

import numpy as np

import twin


def main(folder: Path = Path("snake")) -> None:
    # %% `twin new snake --family continuum` writes the same folder: every number with its unit and a comment.
    from twin.robots.starter import write_starter

    if not folder.exists():
        write_starter(folder.name, "continuum", folder.parent)
    toml = folder / "robot.toml"
    print(toml.read_text()[:400], "...")

    # %% A robot's file makes a twin; numbers may be given other values without editing it.
    described = twin.Twin.load(folder)
    stiffer = twin.Twin(described.robot, {"backbone.youngs_modulus": 1.1 * described.robot.value("backbone.youngs_modulus")})

    # %% Pull one tendon slowly, and see how far the tip goes.
    pull = np.linspace(0.0, 1.0, 21)
    commands = twin.commands(described, {"tendon_1_tension": pull}, rate=1.0)
    for name, robot in (("as described", described), ("10 % stiffer", stiffer)):
        values = robot.predict(commands).trials[0].values
        last = [column for channel, column in values.items() if channel.endswith("_x")][-1]
        print(f"{name}: the last disk moves by {1e3 * abs(last[-1] - last[0]):.1f} mm towards x")


if __name__ == "__main__":
    main()
