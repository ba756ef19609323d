"""Parsing of tables, quantities and their plausibility; errors name the place at fault."""
