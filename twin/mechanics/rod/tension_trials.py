"""A trial under given tensions, sample by sample: creep advances in measured time, one static solve a sample, warm-started.

The order in which loads are applied matters, since friction has memory (millimetres under a sideways payload): straight and
unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `START_STEPS` equal steps; then the log.
Within a sample all tensions change together.

This loop is separate from held_trials.py because it compiles in half the time.
"""

from twin.foundation.compiled import assign, jit, jit_inline
from twin.mechanics.rod.balance.newton import is_minimum, single_newton_step
from twin.mechanics.rod.continuation import next_equilibrium
from twin.mechanics.rod.trial_steps import (
    START_STEPS,
    apply_loads,
    apply_stiffness,
    borrow_tangent,
    creep_under_last_shape,
    guess_shape,
    needs_small_parts,
    record_sample,
    unloaded_trial,
)

RAMP_TOLERANCE = 1e-6  # rad


@jit_inline
def set_tensions(trial, drive, i, weight, before):
    """Set the tensions of sample i times `weight`, and the last ones times `before`."""
    factor = trial.actuation.softness[0]
    for t in range(trial.state.T.size):
        trial.state.T[t] = factor * drive.command[i, t] * weight
        trial.last_tension[t] = factor * drive.command[max(0, i - 1), t] * before


@jit_inline
def solve_present_tensions(trial, neighbour, tol):
    """Find the equilibrium at the trial's present tensions. Return its status, as `next_equilibrium`."""
    in_parts = needs_small_parts(trial, neighbour)
    return next_equilibrium(trial.system, trial.state, trial.factors, trial.last_tension, trial.last_shape, tol, in_parts)


@jit_inline
def start_trial(trial, drive, neighbour, tol):
    """Apply loads, then the first tensions in equal steps. Return the status of the start, as `apply_loads` does."""
    started, has_friction = 1, trial.system.law.mu > 0.0
    if has_friction or neighbour.q.size == 0:  # else the start does not influence the trial
        started = apply_loads(trial, tol)
        steps = START_STEPS if has_friction else 1
        for k in range(1, steps + 1):
            set_tensions(trial, drive, 0, k / steps, (k - 1) / steps)
            assign(trial.last_shape, trial.state.q)
            if solve_present_tensions(trial, neighbour, RAMP_TOLERANCE) == 0:
                started = 0
    assign(trial.last_shape, trial.state.q)
    assign(trial.shape_before, trial.state.q)
    return started


@jit_inline
def solve_sample(trial, neighbour, mode, i):
    """Find the equilibrium of sample i. Return its status; without one the last shape stays.

    With friction the solve is always full: slip would carry the error of a single step on to all later samples.
    """
    if mode.single_step and neighbour.q.size > 0 and not trial.system.law.mu > 0.0:
        status = single_newton_step(trial.system, trial.state, neighbour.LU[i])
    else:
        borrow_tangent(trial, neighbour, i)
        status = solve_present_tensions(trial, neighbour, mode.tol)
    if status == 0:
        assign(trial.state.q, trial.last_shape)
    return status


@jit_inline
def keep_tangent(trial, LU):
    """Store the factors of the present tangent in LU; those last used where it has none."""
    if not is_minimum(trial.system, trial.state, LU):
        for k in range(trial.last_shape.size):
            assign(LU[k], trial.factors.LU[k])


@jit
def run_trial(described, drive, creep, neighbour, mode, state, result):
    """Solve a whole trial of the system `described`, and fill `result`. `state` becomes that at the end.

    Returns the status of the start.
    """
    trial = unloaded_trial(described, drive, creep, state)
    started = start_trial(trial, drive, neighbour, mode.tol)
    for i in range(drive.time.size):
        if creep.amplitude.size and i > 0:
            creep_under_last_shape(trial, creep, drive.time[i] - drive.time[i - 1])
        guess_shape(trial, neighbour, i)
        apply_stiffness(trial, drive, i, 1.0)
        set_tensions(trial, drive, i, 1.0, 1.0)
        result.status[i] = solve_sample(trial, neighbour, mode, i)
        if mode.keep_tangents:
            keep_tangent(trial, result.LU[i])
        assign(trial.last_shape, state.q)
        record_sample(trial, i, result)
    return started
