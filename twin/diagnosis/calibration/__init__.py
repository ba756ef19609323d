"""The fit of a robot's own parameters, and those of effects, to the fitted trials."""
