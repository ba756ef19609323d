"""The search over sets of effects, and the choice among them."""
