"""Days of simulators that are diagnosed and counted."""
