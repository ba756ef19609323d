"""One mutant in a copy of the tree: its tests run in a process that has the libraries loaded and nothing of the program."""

import ast
import multiprocessing
import os
import shutil
import sys
import tempfile
from pathlib import Path

from tools.mutants.groups import GROUPS, group_of
from tools.mutants.mutant import Mutant

PARTS = ("twin", "tools", "tests", "models", "pyproject.toml")
LIBRARIES = ["numpy", "scipy.optimize", "scipy.interpolate", "mujoco", "numba", "pydantic", "pint", "pytest"]
COMPILING_SECONDS = 600.0  # s
LEAST_DIFFERENT = 10  # s by which a file's time is moved, for readers that keep what they made of it


class Tree:
    """A copy of the program to be changed, with what is compiled of it already: files keep their times."""

    def __init__(self, root: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="mutants_"))
        for part in PARTS:
            copy = shutil.copytree if (root / part).is_dir() else shutil.copy2
            copy(root / part, self.folder / part)
        self.context = multiprocessing.get_context("forkserver")
        self.context.set_forkserver_preload(LIBRARIES)

    def texts(self) -> dict[str, str]:
        """Of all modules that have a group, by path."""
        paths = sorted(p.relative_to(self.folder).as_posix() for p in (self.folder / "twin").rglob("*.py"))
        return {p: (self.folder / p).read_text() for p in paths if group_of(p)}

    def outcome(self, mutant: Mutant, patience: float) -> str:
        """ "killed", "timed out" or "survived".

        Compiled code is kept by the time of the file that holds a function, not of those it calls: a change of a compiled
        module outside its classes gets an empty store and the time to fill it, and any file its time back.
        """
        path = self.folder / mutant.file
        text, stat = path.read_text(), path.stat()
        compiled = "twin.foundation.compiled" in text and not _in_class(text, mutant.number)
        store = Path(tempfile.mkdtemp(dir=self.folder)) if compiled else None
        try:
            path.write_text(mutant.applied(text))
            os.utime(path, (stat.st_atime, stat.st_mtime + LEAST_DIFFERENT))  # bytecode is kept by time and size
            code = self.run(str(group_of(mutant.file)), store, patience + COMPILING_SECONDS * compiled)
        finally:
            path.write_text(text)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            if store is not None:
                shutil.rmtree(store)
        return {0: "survived", None: "timed out"}.get(code, "killed")

    def run(self, group: str, store: Path | None, patience: float | None) -> int | None:
        """pytest's exit code for a group's tests; None where they did not end in `patience` (s). Compiled code is
        kept in `store`, None: beside the modules."""
        process = self.context.Process(target=_tests, args=(str(self.folder), str(store or ""), GROUPS[group].tests))
        process.start()
        process.join(patience)
        if process.is_alive():
            process.kill()
            process.join()
            return None
        return process.exitcode

    def close(self) -> None:
        shutil.rmtree(self.folder)


def _in_class(text: str, number: int) -> bool:
    """Whether line `number` belongs to a class; numba compiles none here."""
    classes = [n for n in ast.parse(text).body if isinstance(n, ast.ClassDef)]
    return any(c.lineno <= number <= (c.end_lineno or c.lineno) for c in classes)


def _tests(folder: str, store: str, arguments: tuple[str, ...]) -> None:
    import numba
    import pytest

    os.chdir(folder)
    sys.path.insert(0, folder)
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    numba.config.CACHE_DIR = store  # type: ignore[attr-defined]
    sys.exit(int(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *arguments])))
