"""The noise of sensors and readings: its model, its estimate from the data, and residuals made white by it."""
