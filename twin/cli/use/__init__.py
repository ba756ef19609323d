"""Commands that use a twin."""
