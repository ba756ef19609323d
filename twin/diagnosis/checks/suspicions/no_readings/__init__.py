"""Readings that are none: zeros, fills and stuck values, markers under each other's names for a while, roll-overs.

series.py   what each channel or marker reads, trial by trial
repeats.py  zeros of a lost marker, a fill far from its neighbours, a value that repeats while the robot moves
drives.py   cells of a drive that the outputs do not answer to
jumps.py    two markers exchanged for a while, a reading that rolls over
"""
