"""Identifiers as words for people."""

ABBREVIATIONS = {"sma": "SMA"}  # words that are abbreviations


def display_name(identifier: str) -> str:
    """Return an identifier as words: tendon_friction -> tendon friction, sma_cooling -> SMA cooling."""
    return " ".join(ABBREVIATIONS.get(word, word) for word in identifier.split("_"))
