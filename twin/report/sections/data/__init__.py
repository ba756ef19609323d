"""Sections about the data and the robot: loops, shapes, identifiability, parameters, noise, notices."""
