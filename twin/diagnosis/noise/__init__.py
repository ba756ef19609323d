"""The noise of sensors and readings: its model, its estimate from the data, and the whitening of residuals."""
