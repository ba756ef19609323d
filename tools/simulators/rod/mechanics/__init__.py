"""Rods pulled by tendons: equations, frames and equilibria of the independent simulator."""
