"""Short scripts, one a capability, each to be read from top to bottom: python -m tools.examples.NAME."""
