"""`twin new`: make a folder to describe a new robot."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import out


@dataclass(frozen=True)
class New:
    """Begin a new robot: a commented robot.toml that loads, and a measurement set to fill in."""

    name: Positional[Annotated[str, arg(help="name of the robot and of its folder")]]
    family: Annotated[str | None, arg(help="family of the body; an unknown name lists those available")] = None
    mjcf: Annotated[Path | None, arg(help="instead of --family: your own MuJoCo model; it is copied with the files it needs")] = (
        None
    )
    out: Annotated[Path, arg(help="where to put the folder")] = Path()

    def run(self) -> None:
        from twin.robots.starter import FIRST_SET, begin_robot

        folder, assumed = begin_robot(self.name, self.family, self.mjcf, self.out)
        words = [
            f"1. describe the robot: {folder / 'robot.toml'}", f"2. check the picture: twin robots {folder}",
            f"3. fill {folder / FIRST_SET}", f"4. twin diagnose {folder / FIRST_SET}", *assumed,
        ]  # fmt: skip
        out.print("\n".join(words), highlight=False, markup=False)
