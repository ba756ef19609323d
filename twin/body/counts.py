"""The number of drives of a robot, which also knows the names of its joints."""

from __future__ import annotations


class Counts(int):
    """A number of drives (tendons, actuators) that also names the joints, so that effects can have parameters for each of these.

    It is the int wherever the drives are counted.

    >>> two = Counts.of(2, ("hip", "knee"))
    >>> two + 1, two.joints
    (3, ('hip', 'knee'))
    """

    joints: tuple[str, ...] = ()

    @staticmethod
    def of(drives: int, joints: tuple[str, ...]) -> Counts:
        """Return the counts of a robot with this many drives and these joints."""
        made = Counts(drives)
        made.joints = joints
        return made

    def __reduce__(self) -> tuple[object, ...]:
        return Counts.of, (int(self), self.joints)


def joint_names(n: int) -> tuple[str, ...]:
    """Return the names of the joints of a number of drives; none of a plain number."""
    return n.joints if isinstance(n, Counts) else ()
