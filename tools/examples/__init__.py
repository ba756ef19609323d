"""Short scripts, one a capability; each writes a page to look at."""
