"""First- and second-order lag behind commands between rows, solved exactly."""

from __future__ import annotations

import numpy as np

from twin.body.signals import Signals, interpolate_commands
from twin.foundation.compiled import jit


@jit
def lag_over(x, v, cubic, t, lag, inertia):
    """Return x and x' after t s of the lag that `lag_response` solves, from x and x' = v, behind one `cubic` (4,)."""
    b = inertia * lag * lag
    second, third = lag * lag - b, lag * (lag * lag - 2.0 * b)
    jerk, bend, slope, c = 6.0 * cubic[0], 2.0 * cubic[1], cubic[2], cubic[3]
    e = x - (c - lag * slope + second * bend - third * jerk)
    u = v - (slope - lag * bend + second * jerk)
    c += t * (slope + t * (bend / 2.0 + t * jerk / 6.0))
    slope += t * (bend + t * jerk / 2.0)
    bend += t * jerk
    if inertia == 0.0:
        e *= np.exp(-t / lag)
    else:
        s = 0.5 * lag / b
        w = np.sqrt(abs(s * s - 1.0 / b))
        if w * t < 1e-6:  # critically damped: the error is of the order of its square
            C, S = np.exp(-s * t), t * np.exp(-s * t)
        elif s * s > 1.0 / b:
            fast, slow = np.exp(-(s + w) * t), np.exp(-t / (b * (s + w)))
            C, S = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
        else:
            C, S = np.exp(-s * t) * np.cos(w * t), np.exp(-s * t) * np.sin(w * t) / w
        e, u = e * C + (u + s * e) * S, u * C - (e / b + s * u) * S
    return c - lag * slope + second * bend - third * jerk + e, slope - lag * bend + second * jerk + u


@jit
def lag_response(time, cubics, lag, inertia, delivered):
    """Solve inertia lag^2 x'' + lag x' + x = c exactly, from rest at the first of `time` (n,), and write x to `delivered` (n, m).

    Between rows the commands c are `cubics` (4, n - 1, m), coefficients from the third power down. With a = lag and
    b = inertia lag^2, the particular solution is p = c - a c' + (a^2 - b) c'' - (a^3 - 2 a b) c'''. The difference e = x - p decays
    as exp(-t / a) in first order, and in second order as exp(-s t) (e C + (e' + s e) S) with s = a / (2 b), w^2 = s^2 - 1 / b,
    C = cosh(w t), S = sinh(w t) / w.
    """
    for j in range(cubics.shape[2]):
        x, v = cubics[3, 0, j], 0.0
        delivered[0, j] = x
        for i in range(1, time.size):
            x, v = lag_over(x, v, cubics[:, i - 1, j], time[i] - time[i - 1], lag, inertia)
            delivered[i, j] = x


def late_by(predicted: list[Signals]) -> float:
    """Return how late (s) fits of a lag or a delay begin: 0.1 s, less than a row of most logs; a row where controls drive.

    A body that moves by itself answers a tenth of a second with errors that no derivative leads back from.
    """
    rows = [np.diff(s.time) for s in predicted if s.driven_by_control.any() and len(s.time) > 1]
    return min([0.1, *(float(np.median(gaps)) for gaps in rows)])


def damped(command: Signals, time: float) -> Signals:
    """Return the tensions that statics needs to give the shapes of a body with damping, of damping over stiffness `time` (s).

    K (q + time q') = F(T) is the shape under tensions that follow T with a first-order lag, exactly where shapes are
    proportional to tensions. Lengths are imposed and springs are slow: they stay as they are.
    """
    pulled = ~(command.driven_by_length | command.driven_by_current | command.driven_by_control)
    if not (time > 0.0 and pulled.any() and len(command.time) > 1):
        return command
    out = np.empty_like(command.tension)
    lag_response(np.asarray(command.time, float), interpolate_commands(command, command.tension).c, time, 0.0, out)
    return command.with_changes(tension=np.where(pulled, out, command.tension))
