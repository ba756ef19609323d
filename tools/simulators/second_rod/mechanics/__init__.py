"""Rods pulled by tendons, a second time: contact, fields and equilibria."""
