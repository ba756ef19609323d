"""Writes a robot's description: the MJCF with its described numbers and a robot.toml that says how well each is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.simulators.articulated.robots import BASE, Drive, Robot, Winch, tolerances

SOURCE = "the maker's tolerances"


def _sites(robot: Robot, link: int, pad: str) -> list[str]:
    return [f'{pad}<site name="{v.name}" pos="{v.x:g} 0 {v.z:g}"/>' for v in robot.vias if v.link == link]


def _joint(robot: Robot, i: int) -> str:
    joint = robot.joints[i]
    parts = [f'<joint name="{joint.name}"']
    if joint.stiffness > 0.0:
        parts.append(f'stiffness="{joint.stiffness:g}" springref="{np.rad2deg(joint.rest):.10g}"')
    if joint.armature > 0.0:
        parts.append(f'armature="{joint.armature:g}"')
    parts.append(f'damping="{joint.damping:g}" range="{np.rad2deg(joint.low):.10g} {np.rad2deg(joint.high):.10g}"/>')
    return " ".join(parts)


def _bodies(robot: Robot) -> list[str]:
    """Return the nested bodies, and the tip's site in the last."""
    lines, at = [], 0.0
    for i, link in enumerate(robot.links):
        pad, turn = "  " * (i + 4), f"{link.inertia:g}"
        lines += [
            f'{"  " * (i + 3)}<body name="{link.name}" pos="{at:g} 0 0">',
            f'{pad}<inertial pos="{link.com:g} 0 0" mass="{link.mass:g}" diaginertia="{0.3 * link.inertia:g} {turn} {turn}"/>',
            f"{pad}{_joint(robot, i)}",
            f'{pad}<geom size="{0.12 * link.length:g}" fromto="0 0 0 {link.length:g} 0 0"/>',
            *_sites(robot, i, pad),
        ]
        at = link.length
    lines.append(f'{"  " * (len(robot.links) + 3)}<site name="{robot.tip}" pos="{at:g} 0 0"/>')
    return lines + [f"{'  ' * (i + 3)}</body>" for i in reversed(range(len(robot.links)))]


def _actuator(drive: Drive) -> str:
    gains = f'gainprm="{drive.kp:g}" biastype="affine" biasprm="0 -{drive.kp:g} -{drive.kv:g}"'
    if isinstance(drive, Winch):
        return f'    <general name="{drive.name}" tendon="{drive.target}" {gains} forcerange="-{drive.limit:g} 0"/>'
    return f'    <general name="{drive.name}" joint="{drive.target}" {gains} forcerange="-{drive.limit:g} {drive.limit:g}"/>'


def mjcf(robot: Robot) -> str:
    """Return the MJCF text of a robot."""
    axis, (gx, gz) = (1 if robot.sense < 0.0 else -1), robot.gravity
    lines = [
        f'<mujoco model="{robot.name}">',
        '  <compiler angle="degree" autolimits="true"/>',
        f'  <option timestep="0.0005" integrator="implicitfast" gravity="{gx:g} 0 {gz:g}"/>',
        "  <default>",
        f'    <joint type="hinge" axis="0 {axis} 0" solreflimit="0.004 1" solimplimit="0.99 0.999 0.0001"/>',
        '    <geom contype="0" conaffinity="0" type="capsule" rgba=".8 .8 .85 1"/>',
        '    <site size="0.0008" rgba="1 .4 .2 1"/>',
        "  </default>",
        "  <worldbody>",
        '    <body name="base">',
        '      <geom type="sphere" size="0.01" mass="1"/>',
        *_sites(robot, BASE, "      "),
        *_bodies(robot),
        "    </body>",
        "  </worldbody>",
    ]
    if robot.winches:
        lines.append("  <tendon>")
        for winch in robot.winches:
            sites = [f'      <site site="{v.name}"/>' for v in robot.vias if v.tendon == winch.target]
            lines += [f'    <spatial name="{winch.target}" width="0.0006">', *sites, "    </spatial>"]
        lines.append("  </tendon>")
    lines += ["  <actuator>", *(_actuator(drive) for drive in robot.drives), "  </actuator>", "</mujoco>"]
    return "\n".join(lines) + "\n"


def robot_toml(robot: Robot) -> str:
    """Return the text of robot.toml."""
    lines = [
        'format = "twin-robot/1"', 'family = "mjcf"', f'title = "{robot.title}"', "",
        "[structure]", f'model = "{robot.name}.xml"', "", "[parameters]",
    ]  # fmt: skip
    spreads: dict[str, list[float]] = {}
    for t in tolerances(robot):
        if t.axis is None:
            lines.append(f'"{t.key}" = {{ relative_std = {t.std:g}, source = "{SOURCE}" }}')
        else:
            size = getattr(getattr(robot, t.group)[t.index], t.field) if t.relative else 1.0
            spreads.setdefault(t.key, [0.0, 0.0, 0.0])[t.axis] = t.std * size
    for key, spread in spreads.items():
        numbers = ", ".join(f"{s:g}" for s in spread)
        lines.append(f'"{key}" = {{ std = [{numbers}], unit = "m", source = "{SOURCE}" }}')
    accuracy = 1e3 * sum(link.length for link in robot.links) / 2000.0
    lines += ["", "[accuracy]", f"value = {accuracy:.2g}", 'unit = "mm"', f'source = "{SOURCE}"']
    return "\n".join(lines) + "\n"


def write_robot(folder: Path, robot: Robot) -> None:
    """Write a described robot into a folder of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{robot.name}.xml").write_text(mjcf(robot))
    (folder / "robot.toml").write_text(robot_toml(robot))
