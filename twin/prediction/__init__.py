"""A robot with parameters and effects: predictions, their error, and the file of a twin.

twin.py       the twin                                     simulate.py     simulated trials, static or in motion
prepared.py   a recording prepared for a robot             evaluate.py     the error of a twin on data
damping.py    whether shapes follow fast tensions late
twin_file/    twin.toml                                    solver_pool.py  compiled solvers for reuse
kinematics/   tensions to shape and back                   rollout/        predictions under given or drawn controls
"""
