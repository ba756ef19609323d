"""The number of drives of a robot, which also knows the names of its joints and tendons."""

from __future__ import annotations

from typing import NamedTuple


class Winch(NamedTuple):
    """An actuator (from 0) that winds a tendon: its length is `gear` times the tendon's, its force -1 / gear times the tension."""

    tendon: str
    actuator: int
    gear: float


class Counts(int):
    """A number of drives (actuators) that also names the joints and tendons, so that effects can have parameters for each of these.

    It is the int wherever the drives are counted.

    >>> two = Counts.of(2, ("hip", "knee"))
    >>> two + 1, two.joints
    (3, ('hip', 'knee'))
    """

    joints: tuple[str, ...] = ()
    tendons: tuple[str, ...] = ()
    winches: tuple[Winch, ...] = ()
    crossing: tuple[str, ...] = ()

    @staticmethod
    def of(
        drives: int,
        joints: tuple[str, ...],
        tendons: tuple[str, ...] = (),
        winches: tuple[Winch, ...] = (),
        crossing: tuple[str, ...] = (),
    ) -> Counts:
        """Return the counts of a robot with so many drives, these joints, tendons and winches; `crossing` tendons cross a hinge."""
        made = Counts(drives)
        made.joints, made.tendons, made.winches, made.crossing = joints, tendons, winches, crossing
        return made

    def __reduce__(self) -> tuple[object, ...]:
        return Counts.of, (int(self), self.joints, self.tendons, self.winches, self.crossing)


def joint_names(n: int) -> tuple[str, ...]:
    """Return the names of the joints of a number of drives; none of a plain number."""
    return n.joints if isinstance(n, Counts) else ()


def tendon_names(n: int) -> tuple[str, ...]:
    """Return the names of the tendons of a number of drives of an MJCF; none of a plain number."""
    return n.tendons if isinstance(n, Counts) else ()


def winches(n: int) -> tuple[Winch, ...]:
    """Return what winds the tendons of an MJCF; nothing of a plain number."""
    return n.winches if isinstance(n, Counts) else ()


def crossing_tendons(n: int) -> tuple[str, ...]:
    """Return the names of the tendons of an MJCF that run over sites and cross a hinge; none of a plain number."""
    return n.crossing if isinstance(n, Counts) else ()


def of_a_model(n: int) -> bool:
    """Return whether these are the drives of an MJCF, which has names."""
    return isinstance(n, Counts)
