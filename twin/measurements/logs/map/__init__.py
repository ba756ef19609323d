"""The map of a log, which says what becomes of each of its streams: the file, and its commented text."""
