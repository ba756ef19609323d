"""A silicone finger and a hand: mesh, cables, skin and equilibria of the independent simulator."""
