"""Force balance of a chain of hinges, its tangent, and Newton's method, in compiled code.

chain.py             residual and tangent of the chain              elastic.py        bending of joint sets
newton.py            equilibria under given tensions                hyperelastic.py   bodies that stretch
lengths.py           equilibria with tendons held at lengths        linear.py         dense factorisation
tendon_actuation.py  motors and SMA springs that hold tendons       compile_chain.py  the chain from its MuJoCo model
"""
