"""Shared by all effects: the base class, the chain of effects in force, scaling to a robot's size, drifts that level off."""
