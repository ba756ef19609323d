"""Foundation of all packages: errors, units, parameters, files, compiled code, parallel work.

errors.py      the errors a user sees             units.py          units as people write them, to SI and back
parameters.py  value, unit, bounds, prior         display_names.py  identifiers as words
files.py       limits and checks on reading       file_schema.py    which keys and types a file's tables have
toml_file.py   TOML files of a declared format    atomic_write.py   whole-or-nothing writing
compiled.py    functions compiled by numba        parallel.py, threads.py   work for several cores
"""
