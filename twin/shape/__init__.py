"""Shape of a robot from its sensors: markers of a rod from load cells, the surface of a soft finger from strain sensors.

sensing.py        from a trial to resistances and tendon displacements
pushed_trials.py  a check of the strain sensors in trials with external contact
predict.py        a recording's shapes as a file
estimators/       one estimator a module, found by its file's name, and what they share
alignment/        alignment of a twin to a built finger by partial clouds, band widening, drift correction
training/         training of estimators with weights (torch)
training_data/    random shapes of a finger to train on
"""

from twin.shape.estimators.tension_shape import TensionShapeEstimate, TensionShapeFilter

__all__ = ["TensionShapeEstimate", "TensionShapeFilter"]
