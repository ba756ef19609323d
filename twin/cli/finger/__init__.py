"""Commands for soft fingers."""
