"""The documentation site, made from the repository's own pages and docstrings."""
