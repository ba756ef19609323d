"""The soft body that stretches, against a rod: the differential equations of a neo-Hookean Kirchhoff rod pulled by tendons in
channels, solved by shooting with scipy. It shares no code with the chain.

Backward from the free tip, where force and moment are zero, so that only the tip's rotation is unknown:

    dp/ds = lambda R e3,  dR/ds = R [kappa]x,  dM/ds = -dp/ds x N,  N(s) = g int_s^L rho A,

N and M the force and moment on the section, tendons included. In it, with t_i the unit tangent of tendon i at r_i,
lambda e3 + lambda^(-1/2) (kappa x r_i + dr_i/ds), where r_i is its place at rest, the material carries M - sum T_i lambda^(-1/2)
r_i x t_i and, along e3, N - sum T_i (t_i - 1/2 lambda^(-3/2) t_i . (kappa x r_i + dr_i/ds)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from twin.body import Loads, Problem
from twin.foundation.parameters import fill_defaults
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.chain import ChainState, force_balance
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.robots import load
from twin.robots.families.continuum import build

GRAVITY = np.array([0.0, 0.0, 9.81])
E3 = np.array([0.0, 0.0, 1.0])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two vectors, ten times faster than np.cross, which the shooting spends its time in."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass(frozen=True)
class SoftRod:
    """The tentacle as its robot.toml describes it, in numbers written here again."""

    modulus: float = 0.315e6
    density: float = 1318.0
    length: float = 0.360
    end: float = 0.305  # of the tendons

    def radius(self, s: float) -> float:
        return float(np.interp(s, [0.0, 0.305, 0.360], [15.41e-3, 6.42e-3, 4.80e-3]))

    def strain(self, s: float, m: np.ndarray, n: float, tension: np.ndarray, pulled: bool, guess: np.ndarray) -> np.ndarray:
        """(kappa, lambda) that carry the section's moment m (3,) and axial force n in the body frame."""
        A = np.pi * self.radius(s) ** 2
        EA, EI = self.modulus * A, self.modulus * A**2 / (4 * np.pi)
        stiff = np.array([EI, EI, 2 * EI / 3])
        angle = np.deg2rad([-60.0, 60.0])
        out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)

        def lack(x: np.ndarray) -> np.ndarray:
            k, a = x[:3], x[3]
            b, db = (1 / a + 2 / a**4) / 3, -(1 / a**2 + 8 / a**5) / 3
            law, slope = np.array([b, b, 1 / a]), np.array([db, db, -1 / a**2])
            moment, force = stiff * law * k, EA * (a - a**-2) / 3 + 0.5 * float((stiff * slope * k**2).sum())
            for i in range(2 if pulled else 0):
                r, dr = (11.4e-3 - 0.0295 * s) * out[i], -0.0295 * out[i]
                wide = max(a, 0.1) ** -0.5  # the section, and the channel's place in it
                t = a * E3 + wide * (cross(k, r) + dr)
                t = tension[i] * t / np.linalg.norm(t)
                moment, force = moment + wide * cross(r, t), force + t[2] - 0.5 * wide / a * float(t @ (cross(k, r) + dr))
            return np.append((moment - m) / EI, (force - n) / EA)

        return np.asarray(fsolve(lack, guess, xtol=1e-11))

    def shape(self, tension: np.ndarray, at: list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Positions (k, 3) and rotations (k, 3, 3) at arc lengths `at`, in the base frame."""
        x = np.zeros(3)
        for share in (0.25, 0.5, 0.75, 1.0):  # the branch that hangs down at rest
            x, *_ = fsolve(lambda v: self._march(v, share * tension, [])[0].as_rotvec(), x, full_output=True, xtol=1e-9)  # noqa: B023
        _, base, p, R = self._march(x, tension, at)
        return p - base, R

    def _march(self, tip: np.ndarray, tension: np.ndarray, at: list[float]):
        guess = np.array([0.0, 0.0, 0.0, 1.0])

        def slopes(s: float, y: np.ndarray, pulled: bool) -> np.ndarray:
            R, M, weight = y[3:12].reshape(3, 3), y[12:15], y[15]
            N = weight * GRAVITY
            guess[:] = self.strain(s, R.T @ M, float((R.T @ N)[2]), tension, pulled, guess)
            k, a = guess[:3], guess[3]
            dp = a * R[:, 2]
            spin = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
            return np.concatenate([dp, (R @ spin).ravel(), -cross(dp, N), [-self.density * np.pi * self.radius(s) ** 2]])

        y = np.concatenate([np.zeros(3), Rotation.from_rotvec(tip).as_matrix().ravel(), np.zeros(4)])
        found = {}
        for start, end, pulled in ((self.length, self.end, False), (self.end, 0.0, True)):
            inside = sorted((s for s in at if end <= s <= start and s not in found), reverse=True)
            run = solve_ivp(
                slopes,
                (start, end),
                y,
                t_eval=[*inside, end] if end not in inside else inside,
                args=(pulled,),
                rtol=1e-7,
                atol=1e-9,
            )
            found |= dict(zip(inside, run.y.T, strict=False))
            y = run.y[:, -1]
        p, R = np.array([found[s][:3] for s in at]), np.array([found[s][3:12].reshape(3, 3) for s in at])
        return Rotation.from_matrix(y[3:12].reshape(3, 3)), y[:3], p, R


AT = [0.1291, 0.2195, 0.2800, 0.360]
OFFSET = np.array([[25.0, 0, 0], [-21.0, 0, 0], [20.0, 0, 0], [0, 0, 8.0]]) * 1e-3


def finer(times: int) -> Equilibrium:
    """The tentacle with every disk interval divided."""
    robot = load("tentacle")
    values = fill_defaults(robot.parameters, {"backbone.youngs_modulus": 0.315e6, "backbone.density": 1318.0})
    n = int(robot.structure["disks"])  # type: ignore[call-overload]
    pitch = [values[f"disks.pitch_{k}"] for k in range(1, n + 1)]
    structure = {**robot.structure, "disks": n * times, "tendons_end": times * robot.structure["tendons_end"]}  # type: ignore[operator]
    structure["markers"] = [times * k for k in robot.structure["markers"]]  # type: ignore[attr-defined]
    return Equilibrium(
        build(structure, {**values, **{f"disks.pitch_{k + 1}": pitch[k // times] / times for k in range(n * times)}})
    )


def markers(solver: Equilibrium, tension: np.ndarray) -> np.ndarray:
    path = solver.solve(Problem(np.zeros(1), tension[None].copy(), Loads(GRAVITY)))
    assert path.status.all()
    return path.markers[0, :4]


PULLS = {
    "at rest": (0.0, 0.0),
    "one tendon": (5.54, 0.0),
    "both, unequal": (3.08, 6.15),
    "both": (6.15, 6.15),
    "hardest": (7.69, 0.0),
}
# m, with the robot's own intervals: its [accuracy] is the mean over all holds; these are the worst marker of each
WORST = {"at rest": 1e-5, "one tendon": 1.0e-3, "both, unequal": 1.0e-3, "both": 1.2e-3, "hardest": 3.2e-3}


@pytest.mark.parametrize("pull", PULLS)
def test_the_chain_is_the_rod_and_more_so_when_finer(pull: str) -> None:
    tension = np.array(PULLS[pull])
    p, R = SoftRod().shape(tension, AT)
    truth = p + np.einsum("kij,kj->ki", R, OFFSET)
    coarse, fine = (np.linalg.norm(markers(finer(k), tension) - truth, axis=1).max() for k in (1, 2))
    assert coarse < WORST[pull]
    # second order: a quarter when halved, three tenths with what is left of higher orders; 1e-5 m is the shooting's own error
    assert fine < 0.3 * coarse + 1e-5


def test_it_hangs_as_a_neo_hookean_cone() -> None:
    """At rest the tip sinks by int (lambda - 1) ds, (lambda - lambda^-2) EA/3 = weight below, a scalar equation a slice."""
    rod = SoftRod()
    s = np.linspace(0, rod.length, 2001)
    A = np.pi * np.array([rod.radius(x) for x in s]) ** 2
    slices = 0.5 * (A[1:] + A[:-1]) * np.diff(s)
    below = 9.81 * rod.density * np.append(np.cumsum(slices[::-1])[::-1], 0.0)
    stretch = np.array([np.roots([1.0, -3 * w / (rod.modulus * a), 0.0, -1.0]).real.max() for w, a in zip(below, A, strict=True)])
    tip = markers(finer(1), np.zeros(2))[3, 2]
    # m: 1.3 mm of stretch, by the trapezoidal rule over the joints
    np.testing.assert_allclose(tip, np.trapezoid(stretch, s) + 8e-3, rtol=0, atol=2e-5)


def test_residual_and_tangent_belong_to_one_energy() -> None:
    """J is symmetric without friction and the slope of r, slides among the joints."""
    e = finer(1)
    nv = e.model.nv
    rng = np.random.default_rng(0)
    loads = Loads(np.array([1.0, -2.0, 9.0]), 0.01, np.array([0.1, 0.2, 0.3]), np.array([-1.0, 0.0, 0.0, -0.01, 50.0]))
    under, T = e.statics(Problem(np.zeros(1), np.zeros((1, 2)), loads)), np.array([3.0, 1.0])
    z = np.zeros((2, e.chain.hole.shape[1] - 1))

    def at(q: np.ndarray, J: np.ndarray) -> np.ndarray:
        r = np.full(nv, np.nan)
        update_kinematics(under, q)
        force_balance(under, ChainState(T, q, z, z), z.copy(), z.copy(), r, J)
        return r

    q, J = 0.1 * rng.normal(size=nv) * e.chain.unit, np.full((nv, nv), np.nan)
    at(q, J)
    step = 1e-6
    numeric = np.stack(
        [(at(q + d, np.empty((0, 0))) - at(q - d, np.empty((0, 0)))) / (2 * step) for d in np.diag(step * e.chain.unit)]
    )
    # N m per unit joint, of up to 10: differences over 1e-6 of a moment of 1 N m with 1e-16 of rounding, third derivatives of 1e3
    unit = e.chain.unit[:, None]
    np.testing.assert_allclose(unit * J * e.chain.unit, unit * numeric.T, rtol=0, atol=1e-6)
    np.testing.assert_allclose(J, J.T, rtol=0, atol=1e-9)
