"""Frames along a rod: Gauss-Legendre nodes per interval and Lie-group integration of rotation and position.

    R' = R [u]x ,   r' = R e3        (inextensible, unshearable; u = curvature and twist in the section's frame, 1/m)

In each interval between two disks u(s) is the polynomial through its values at the Gauss nodes. From node to node the
pose is advanced by a fourth-order Magnus step on SE(3), Omega = H/2 (x1 + x2) + sqrt(3)/12 H^2 [x1, x2] with x = (e3, u) at
the two Gauss points of the step (Iserles et al., Lie-group methods, Acta Numerica 2000; sign for g' = g x).
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

_GAUSS_2 = np.array([0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6])


class Mesh(NamedTuple):
    """Collocation on the unit interval with G Gauss nodes."""

    weight: np.ndarray  # (G,) quadrature
    before: np.ndarray  # (G, G) integral of the j-th Lagrange polynomial from 0 to node q
    after: np.ndarray  # (G, G) the same from node q to 1
    leg: np.ndarray  # (G+1,) lengths 0 -> node 1 -> ... -> node G -> 1
    sample: np.ndarray  # (G+1, 2, G) Lagrange polynomials at the two Gauss points of each leg


@cache
def gauss_mesh(nodes: int) -> Mesh:
    x, weight = np.polynomial.legendre.leggauss(nodes)
    x, weight = (x + 1) / 2, weight / 2
    basis = [np.polynomial.Polynomial.fromroots(np.delete(x, j)) for j in range(nodes)]
    basis = [p / p(x[j]) for j, p in enumerate(basis)]
    before = np.array([[p.integ()(xq) - p.integ()(0.0) for p in basis] for xq in x])
    ends = np.concatenate([[0.0], x, [1.0]])
    leg = np.diff(ends)
    sample = np.array([[[p(a + g * h) for p in basis] for g in _GAUSS_2] for a, h in zip(ends[:-1], leg, strict=True)])
    return Mesh(weight, before, weight - before, leg, sample)


@njit(cache=True, error_model="numpy")
def cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def advance(R, r, u1, u2, H, R_out, r_out):
    """One Magnus step of length H from pose (R, r), curvatures u1, u2 at its two Gauss points."""
    beta = np.sqrt(3.0) / 12.0 * H * H
    w = np.empty(3)
    v = np.empty(3)
    # [x1, x2] = (u1 x e3 - u2 x e3, u1 x u2)
    w[0] = 0.5 * H * (u1[0] + u2[0]) + beta * (u1[1] * u2[2] - u1[2] * u2[1])
    w[1] = 0.5 * H * (u1[1] + u2[1]) + beta * (u1[2] * u2[0] - u1[0] * u2[2])
    w[2] = 0.5 * H * (u1[2] + u2[2]) + beta * (u1[0] * u2[1] - u1[1] * u2[0])
    v[0] = beta * (u1[1] - u2[1])
    v[1] = -beta * (u1[0] - u2[0])
    v[2] = H
    th2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if th2 < 1e-8:
        a, b, c = 1 - th2 / 6, 0.5 - th2 / 24, 1 / 6 - th2 / 120
    else:
        th = np.sqrt(th2)
        a, b, c = np.sin(th) / th, (1 - np.cos(th)) / th2, (th - np.sin(th)) / (th2 * th)
    wv = np.empty(3)
    wwv = np.empty(3)
    cross(w, v, wv)
    cross(w, wv, wwv)
    e = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            e[i, j] = b * w[i] * w[j]
        e[i, i] += 1 - b * th2
    e[0, 1] -= a * w[2]
    e[0, 2] += a * w[1]
    e[1, 0] += a * w[2]
    e[1, 2] -= a * w[0]
    e[2, 0] -= a * w[1]
    e[2, 1] += a * w[0]
    for i in range(3):
        r_out[i] = r[i]
        for j in range(3):
            r_out[i] += R[i, j] * (v[j] + b * wv[j] + c * wwv[j])
            R_out[i, j] = R[i, 0] * e[0, j] + R[i, 1] * e[1, j] + R[i, 2] * e[2, j]


@njit(cache=True, error_model="numpy")
def integrate(u, pitch, mesh, node_R, node_r, disk_R, disk_r):
    """Poses of all nodes (N, G) and disks (N+1, base plate first) from the curvature u (N, G, 3)."""
    N, G = u.shape[0], u.shape[1]
    disk_R[0] = np.eye(3)
    disk_r[0] = 0.0
    u1 = np.empty(3)
    u2 = np.empty(3)
    for k in range(N):
        for leg in range(G + 1):
            for i in range(3):
                u1[i] = 0.0
                u2[i] = 0.0
                for j in range(G):
                    u1[i] += mesh.sample[leg, 0, j] * u[k, j, i]
                    u2[i] += mesh.sample[leg, 1, j] * u[k, j, i]
            R, r = (disk_R[k], disk_r[k]) if leg == 0 else (node_R[k, leg - 1], node_r[k, leg - 1])
            H = mesh.leg[leg] * pitch[k]
            if leg == G:
                advance(R, r, u1, u2, H, disk_R[k + 1], disk_r[k + 1])
            else:
                advance(R, r, u1, u2, H, node_R[k, leg], node_r[k, leg])
