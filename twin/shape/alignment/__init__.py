"""Alignment of a twin to a built finger from partial clouds.

align.py       the steps, in order                      report.py           the result on disk cloud_fit.py   the shape behind one
cloud               band_widening.py    band width under the contact seen sensor_fit.py  R0 and kappa from known strains
drift_correction.py sensor drift from free motion
"""
