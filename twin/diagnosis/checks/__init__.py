"""Checks of the data and the design before and after the search: misread files, spikes, loops, jumps of a zero."""
