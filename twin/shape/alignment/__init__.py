"""Alignment of a twin to a built finger from partial clouds.

align.py            the steps, in order                     report.py           the result on disk
cloud_fit.py        the shape behind one cloud              band_widening.py    band width of this finger
sensor_fit.py       R0 and kappa from known strains         drift_correction.py sensor drift from free motion
twin_check.py       whether the twin is of the finger that was measured
"""
