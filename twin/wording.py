"""Identifiers as people say them."""

from __future__ import annotations

CAPITALS = {"sma": "SMA"}  # words that are abbreviations


def in_words(identifier: str) -> str:
    """As in tendon_friction -> tendon friction, sma_cooling -> SMA cooling."""
    return " ".join(CAPITALS.get(word, word) for word in identifier.split("_"))
