"""Independent simulators that write test data, written without sight of the twin; they share no code with it."""
