"""The silicone itself.

law.py     neo-Hookean forces and their tangent     lattice.py   cells, quadrature, weights of material points
creep.py   stress that relaxes                      damping.py   mass and damping within a step
flex.py    the body as MuJoCo moves and collides it
"""
