"""Commands that take a measurement set."""
