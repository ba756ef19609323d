"""The rows of each family's `robot.toml`: units, ranges, defaults and meanings (`twin.robots.schema`)."""
