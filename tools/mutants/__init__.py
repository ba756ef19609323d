"""One line of the program changed: do the tests see it?

    python -m tools.mutants run [--seed 0] [--each 25] [--only GROUP ...]    tries them, into tools/mutants/outcomes.json, resumed
    python -m tools.mutants again [--only GROUP ...]                         what survived without a reason, once more
    python -m tools.mutants table                                            rate by package, and the survivors with their reasons

Mutants are made from the syntax tree (an operator or a sign turned, a comparison's edge moved, a number doubled, halved or one
more, a condition's part exchanged, a statement dropped), a seeded sample of each group of modules, and those written down in
by_hand.py. Each is put into a copy of the tree and only the tests of its module's group are run on it; the first failure ends it.

    killed      a test failed, or the module could no longer be loaded
    timed out   the tests did not end in time; counts as killed
    survived    all tests passed: a test is missing, or reasons.toml says why none can be written

A survivor of these runs has survived the tests of its group, not the whole suite.

    mutant.py   one change, and how it is put into a file        operators.py   those that a syntax tree allows
    by_hand.py  changes that once went unseen                    groups.py      which modules, which tests
    attempt.py  one mutant in a copy of the tree                 __main__.py    many of them, and the table
"""
