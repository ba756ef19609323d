"""Mechanics of the robots' bodies: solvers for rods, silicone and SMA springs."""
