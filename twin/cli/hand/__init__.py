"""Commands for the tasks of a hand."""
