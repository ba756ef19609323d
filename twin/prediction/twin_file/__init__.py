"""`twin.toml`, written and read."""
