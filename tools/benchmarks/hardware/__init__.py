"""Public data of real robots, before and after."""
