"""A trial with tendons held by motors at given lengths or by SMA springs, sample by sample; tensions are unknowns.

Springs pull from the beginning, cold, and rods are held at zero: gravity and payload are applied in `START_STEPS` equal steps with
them. Spring temperatures advance once a sample, under the current and at the elongation of the sample before. Otherwise as
tension_trials.py.
"""

from twin.foundation.by_reference import refer_to
from twin.foundation.compiled import assign, jit, jit_inline
from twin.mechanics.rod.balance.lengths import commit_present_slip, held_tangent, interpolate_target, reach_target, single_held_step
from twin.mechanics.rod.balance.newton import Factors
from twin.mechanics.rod.balance.tendon_actuation import commit_springs
from twin.mechanics.rod.trial_steps import (
    START_STEPS,
    any_true,
    apply_loads,
    apply_stiffness,
    borrow_tangent,
    creep_under_last_shape,
    guess_shape,
    needs_small_parts,
    record_sample,
    unloaded_trial,
)
from twin.mechanics.springs.heat import heated_temperature

HELD_TOLERANCE = 1e-7  # rad; accurate tensions need an accurate shape
# rad, with springs, whose force law goes on from the last sample: with 1e-7 errors of 16 uN a sample would add up, and on a body
# that softens slowly springs would not move at all.
SPRING_TOLERANCE = 1e-9


@jit_inline
def held_tolerance(actuation, tol):
    """Return the tolerance (rad) of a step, no coarser than the held tendons allow."""
    return min(tol, SPRING_TOLERANCE if any_true(actuation.by_spring) else HELD_TOLERANCE)


@jit_inline
def solve_start_step(trial, tol):
    """Find the shape whose tendons are at the target, and commit the springs. Return its status."""
    state, actuation, near_post = trial.state, trial.actuation, trial.system.law.wall[9] > 0.0
    assign(trial.last_shape, state.q)
    tol = held_tolerance(actuation, tol)
    status = reach_target(trial.system, state, trial.factors, actuation, trial.target, tol, near_post)
    commit_springs(actuation, state.s, state.T)
    return status


@jit_inline
def apply_loads_while_held(trial, drive, tol):
    """Apply gravity, payload and force in steps, with cold springs or rods at zero. Return the status of the start, 1 or 0."""
    started = 1
    for k in range(1, START_STEPS + 1):
        apply_stiffness(trial, drive, 0, k / START_STEPS)
        if solve_start_step(trial, tol) == 0:
            started = 0
    return started


@jit_inline
def reset_motor_tendons(trial):
    """Reset the slip of tendons held by motors, which have not moved while the loads came on."""
    for t in range(trial.state.T.size):
        if not trial.actuation.by_spring[t]:
            assign(trial.state.s[t], trial.straight_lengths[t])
            for d in range(trial.state.z.shape[1]):
                trial.state.z[t, d] = 0.0


@jit_inline
def set_command(trial, drive, i, weight):
    """Set displacements and tensions of sample i, times `weight`. Currents act through `heat_springs`."""
    for t in range(trial.state.T.size):
        if drive.driven_by_length[t]:
            trial.target.free_length[t] = drive.straight_path[t] - drive.command[i, t] * weight
        elif not drive.by_spring[t]:
            trial.state.T[t] = trial.actuation.softness[0] * drive.command[i, t] * weight


@jit_inline
def apply_first_command(trial, drive, tol, started):
    """Apply the first displacements and tensions in equal steps. Return the status of the start."""
    for k in range(START_STEPS + 1):
        set_command(trial, drive, 0, k / START_STEPS)
        if solve_start_step(trial, tol) == 0:
            started = 0
    return started


@jit_inline
def start_trial(trial, drive, neighbour, tol):
    """Apply loads, then the first commands. Return the status of the start.

    1, or 2 where the loaded robot has no stable equilibrium near straight, 0 where none was found.
    """
    springs, others, started = any_true(drive.by_spring), False, 1
    remembers = springs or trial.system.law.mu > 0.0 or neighbour.q.size == 0  # else the start does not influence the trial
    if drive.pushes:
        assign(trial.actuation.held, drive.driven_by_length)
    if remembers and (springs or drive.pushes):
        started = apply_loads_while_held(trial, drive, tol)
    elif remembers:
        started = apply_loads(trial, tol)
        trial.factors.usable[0] = False  # that tangent contains no held lengths
    for t in range(trial.state.T.size):
        trial.actuation.held[t] = drive.driven_by_length[t] or drive.by_spring[t]
        others = others or not drive.by_spring[t]
    reset_motor_tendons(trial)
    if others and remembers:
        started = apply_first_command(trial, drive, tol, started)
    assign(trial.last_shape, trial.state.q)
    assign(trial.shape_before, trial.state.q)
    return started


@jit_inline
def heat_springs(trial, drive, i):
    """Advance the target temperatures of the springs from the sample before."""
    actuation, temperature = trial.actuation, trial.target.temperature
    dt = drive.time[i] - drive.time[i - 1]
    for t in range(temperature.size):
        if drive.by_spring[t]:
            current, room = drive.command[i - 1, t], drive.ambient[i - 1]
            temperature[t] = heated_temperature(drive.spring, t, temperature[t], actuation.elongation[t], current, room, dt)


@jit_inline
def guess_tensions(trial, neighbour, i):
    """Take the neighbour's tensions of held tendons as first guess."""
    for t in range(trial.state.T.size):
        if neighbour.q.size and trial.actuation.held[t]:
            trial.state.T[t] = trial.actuation.softness[0] * neighbour.T[i, t]
            trial.factors.held_tendons[t] = trial.state.T[t] > 0.0 or trial.actuation.pushes


@jit_inline
def solve_sample(trial, neighbour, mode, i):
    """Find the equilibrium of sample i. Return its status; without one the last shape stays.

    With friction or backlash the solve is always full: they would carry the error of a single step on to all later samples. Where a
    single step fails, as near the end of a spring's branch, there is no first-order change, and the neighbour's own shape is taken.
    """
    if mode.single_step and neighbour.q.size > 0 and not trial.system.law.mu > 0.0 and not any_true(trial.actuation.backlash > 0.0):
        interpolate_target(trial.actuation, trial.target, trial.target, 1.0)
        own = trial.factors
        factors = refer_to(Factors(neighbour.LU[i], own.usable, own.held_tendons, neighbour.tension_response[i]))
        status = single_held_step(trial.system, trial.state, factors, trial.actuation)
        if status == 0:
            assign(trial.state.q, neighbour.q[i])
            guess_tensions(trial, neighbour, i)
            commit_present_slip(trial.system, trial.state)
            status = 1
    else:
        borrow_tangent(trial, neighbour, i)
        if neighbour.q.size:
            for t in range(trial.state.T.size):
                assign(trial.factors.tension_response[t], neighbour.tension_response[i, t])
        tol, in_parts = held_tolerance(trial.actuation, mode.tol), needs_small_parts(trial, neighbour)
        status = reach_target(trial.system, trial.state, trial.factors, trial.actuation, trial.target, tol, in_parts)
    if status == 0:
        assign(trial.state.q, trial.last_shape)
    return status


@jit_inline
def keep_tangent(trial, LU, tension_response):
    """Store the factors of the present tangent and its tension response; those last used where it has none."""
    held, pushes = trial.actuation.held, trial.actuation.pushes
    if not held_tangent(trial.system, trial.state, held, pushes, LU, trial.factors.held_tendons, tension_response):
        for k in range(trial.last_shape.size):
            assign(LU[k], trial.factors.LU[k])
        for t in range(trial.state.T.size):
            assign(tension_response[t], trial.factors.tension_response[t])


@jit
def run_trial(described, drive, creep, neighbour, mode, state, result):
    """Solve a whole trial, as `tension_trials.run_trial`."""
    trial = unloaded_trial(described, drive, creep, state)
    started = start_trial(trial, drive, neighbour, mode.tol)
    for i in range(drive.time.size):
        if i > 0:
            if creep.amplitude.size:
                creep_under_last_shape(trial, creep, drive.time[i] - drive.time[i - 1])
            heat_springs(trial, drive, i)
        guess_shape(trial, neighbour, i)
        apply_stiffness(trial, drive, i, 1.0)
        set_command(trial, drive, i, 1.0)
        guess_tensions(trial, neighbour, i)
        result.status[i] = solve_sample(trial, neighbour, mode, i)
        if mode.keep_tangents:
            keep_tangent(trial, result.LU[i], result.tension_response[i])
        commit_springs(trial.actuation, state.s, state.T)
        assign(trial.last_shape, state.q)
        record_sample(trial, i, result)
    return started
