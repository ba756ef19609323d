"""Changes that a suite of tests once did not see, by what they break."""

from tools.mutants.mutant import Mutant

CHANGES = (  # (file, what a line holds, what it is to hold)
    # creep keeps what it had through the pause between trials
    (
        "twin/prediction/simulate.py",
        "delayed *= np.exp(-pause / np.array(creep.time))[:, None]",
        "delayed *= np.exp(-0.0 * np.array(creep.time))[:, None]",
    ),
    ("twin/prediction/simulate.py", "end = float(inputs.clock[-1])", "end = float(inputs.clock[0])"),
    # trials without a start all begin at zero
    ("twin/prediction/prepared.py", "now = float(clocks[-1][-1])", "now = 0.0"),
    (
        "twin/prediction/prepared.py",
        "now = trial.start if trial.start is not None else now",
        "now = now if trial.start is not None else now",
    ),
    # a gap is filled with zero
    (
        "twin/prediction/prepared.py",
        "values = np.interp(trial.time, trial.time[known], values[known])",
        "values = np.where(known, values, 0.0)",
    ),
    # softening in kinematics the wrong way round
    ("twin/prediction/kinematics/loaded_robot.py", "self.softness = 1.0 / float(", "self.softness = 1.0 * float("),
    # the error bar without the load cells
    ("twin/shape/estimators/tension_shape.py", "+ self.tension_noise**2 * (G**2).sum(axis=0)", "+ 0.0 * (G**2).sum(axis=0)"),
    # radians called degrees
    ("twin/prediction/evaluate.py", '"angle": OutputGroup("deg", 180.0 / np.pi', '"angle": OutputGroup("deg", 1.0'),
    # a drift ten times as fast
    ("twin/effects/load_cell_drift.py", 'return self.per_tendon_values("rate")', 'return 10.0 * self.per_tendon_values("rate")'),
    ("twin/report/numbers.py", '"N/s": ("N/h", 3600.0)', '"N/s": ("N/h", 36000.0)'),
    # currents are not delayed
    ("twin/effects/time_delay.py", "current=self._heating(reported))", "current=reported.current)"),
    ("twin/effects/time_delay.py", "np.interp(edges - self", "np.interp(edges + self"),
    # markers on the other side of their disks
    ("twin/robots/families/continuum.py", "place = [*offset[:2], at + offset[2]]", "place = [*offset[:2], at - offset[2]]"),
    # the noise model's bar and what it takes out
    ("twin/diagnosis/noise/estimate.py", "sure = CLEAR_CORRELATION * spread", "sure = 0.1 * CLEAR_CORRELATION * spread"),
    ("twin/diagnosis/noise/estimate.py", "sure = CLEAR_CORRELATION * spread", "sure = 10.0 * CLEAR_CORRELATION * spread"),
    ("twin/diagnosis/noise/estimate.py", "return out - moved @ np.linalg.lstsq", "return out - 0.0 * moved @ np.linalg.lstsq"),
    ("twin/diagnosis/noise/estimate.py", "both -= basis[ok] @", "both -= 0.0 * basis[ok] @"),
    # machine code numbered, as numba does
    ("twin/foundation/compiled.py", "super()._data_name(uuid4().int)", "super()._data_name(number)"),
    # a second robot for nothing
    ("twin/diagnosis/checks/mixed_robots.py", "- len(own) * np.log(n) - 2.0", "- 2.0"),
    ("twin/diagnosis/checks/mixed_robots.py", "- 2.0 * len(trials) * np.log(2.0)", "- 0.0 * len(trials) * np.log(2.0)"),
    # standard errors half and twice as large, and without their inflation
    ("twin/diagnosis/calibration/fit.py", "return spread * np.array(", "return 0.5 * spread * np.array("),
    ("twin/diagnosis/calibration/fit.py", "return spread * np.array(", "return 2.0 * spread * np.array("),
    (
        "twin/diagnosis/calibration/fit.py",
        "np.linalg.pinv(self.information())), 0.0) * inflation)",
        "np.linalg.pinv(self.information())), 0.0))",
    ),
    ("twin/diagnosis/held_out.py", "np.quantile(values, [0.025, 0.975])", "np.quantile(values, [0.25, 0.75])"),
)


def by_hand(texts: dict[str, str]) -> list[Mutant]:
    """Of the files given, by name. Raises ValueError where a line has changed: write the mutant anew."""
    return [Mutant.of(file, texts[file], old, new) for file, old, new in CHANGES if file in texts]
