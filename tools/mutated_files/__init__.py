"""Files with mistakes in them, given to the readers: does every one end in one clear line, or in exactly what it says?

    python -m tools.mutated_files [--count 5000] [--seed 0] [--keep FOLDER]

Five kinds of input (robot.toml, twin.toml, measurements.toml, CSV and Parquet, point clouds) are damaged by seeded mutations: names
misspelt, types and units changed, numbers huge, negative or none, nesting, encodings, truncation, columns permuted. Each is read by
the program in a worker process. Counted are

    traceback   anything but a TwinError of one line
    hang        more than 5 s
    memory      more than 1 GB
    meaning     accepted, and not what a second reader (literal.py: tomllib, csv, numpy and pint alone) finds written

    sources.py        whole files to begin with
    toml_mutations.py, table_mutations.py, cloud_mutations.py
    literal.py        the second reader
    worker.py         reads one mutant and says how it went
    __main__.py       many of them, and the table
"""
