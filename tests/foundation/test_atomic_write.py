"""Files appear whole or not at all."""

from pathlib import Path

import pytest

from twin.foundation.atomic_write import write_all_atomically, write_atomically
from twin.foundation.errors import DataError


def test_bytes_and_functions_are_written_over_an_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_atomically(path, b"first")
    write_atomically(path, lambda file: file.write(b"second"))
    assert path.read_bytes() == b"second"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), RuntimeError("broken"), KeyboardInterrupt()])
def test_an_error_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")

    def fail(file) -> None:
        file.write(b"half")
        raise error

    with pytest.raises(DataError if isinstance(error, OSError) else type(error)) as caught:
        write_atomically(path, fail, "free some space")
    if isinstance(error, OSError):
        assert str(caught.value) == f"{path}: cannot be written (No space left on device); free some space"
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("where", ["missing/a.txt", "file/a.txt"])
def test_a_folder_that_is_none_is_refused_in_one_line(tmp_path: Path, where: str) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(DataError, match=r"a\.txt: cannot be written \(.*\); choose another place"):
        write_atomically(tmp_path / where, b"x")


def test_of_several_files_none_is_replaced_where_one_fails(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_bytes(b"old")

    def fail(file) -> None:
        raise OSError("no")

    with pytest.raises(DataError, match="b: cannot be written"):
        write_all_atomically({first: b"new", second: fail})
    assert first.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [first]
