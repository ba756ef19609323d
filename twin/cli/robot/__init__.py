"""Commands about robots and effects."""
