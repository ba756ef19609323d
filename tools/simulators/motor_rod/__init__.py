"""The independent rod on a bench with motors: spools, springs in series, pretension, antagonistic pairs, unknown zeros."""
