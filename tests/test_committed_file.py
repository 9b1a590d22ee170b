"""A file that contains its last committed state at any moment, also after an interrupted commit."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sandboil.files.committed_file import CommittedFile, twin_of

# Offsets and sizes, in bytes, over several of the pages in which changes are stored.
PLACES = st.integers(0, 20_000)


class Killed(BaseException):
    """Simulates the end of the process."""


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("write"), PLACES, st.binary(min_size=1, max_size=9000)),
            st.tuples(st.just("truncate"), PLACES),
            st.tuples(st.just("commit")),
            st.tuples(st.just("reopen")),
        ),
        max_size=30,
    )
)
def test_reading_returns_what_was_written_and_the_disk_has_the_last_commit(
    tmp_path_factory: pytest.TempPathFactory, calls: list[Any]
) -> None:
    path = tmp_path_factory.mktemp("committed") / "file"
    file, written, committed = CommittedFile(path), bytearray(), None
    for name, *arguments in calls:
        if name == "write":
            place, data = arguments
            file.seek(place)
            file.write(data)
            written.extend(bytes(max(0, place - len(written))))
            written[place : place + len(data)] = data
        elif name == "truncate":
            (size,) = arguments
            file.truncate(size)
            written = written[:size].ljust(size, b"\0")
        else:
            file.commit()
            committed = bytes(written)
            if name == "reopen":
                file.close()
                file = CommittedFile(path, exists=True)
        file.seek(0)
        assert file.read() == bytes(written)
        assert committed is None or path.read_bytes() == committed
        assert path.exists() == (committed is not None)
    file.close()
    assert [found.name for found in path.parent.iterdir()] == ([] if committed is None else ["file"])


def killing_at(number: int, monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Raise `Killed` at call `number` of those that change the disk; returns a function that counts them."""
    calls = 0

    def watched(call: Callable[..., Any]) -> Callable[..., Any]:
        def watching(*args: Any, **kwargs: Any) -> Any:
            nonlocal calls
            calls += 1
            if calls == number:
                raise Killed
            return call(*args, **kwargs)

        return watching

    for owner, name in (
        (os, "pwrite"),
        (os, "ftruncate"),
        (os, "fsync"),
        (Path, "replace"),
        (Path, "hardlink_to"),
    ):
        monkeypatch.setattr(owner, name, watched(getattr(owner, name)))
    return lambda: calls


@pytest.mark.parametrize("links", [True, False])
def test_a_kill_between_any_two_steps_of_a_commit_leaves_a_complete_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def no_links(*_: Any) -> None:
        raise PermissionError("this file system has no hard links")

    number, killed = 0, True
    while killed:
        number += 1
        path = tmp_path / f"{number}.h5"
        disk = CommittedFile(path)
        file = h5py.File(disk, "w")
        rows = file.create_dataset("rows", shape=(0, 300), maxshape=(None, 300), chunks=(1, 300), dtype=float)
        with monkeypatch.context() as patch:
            if not links:
                patch.setattr(Path, "hardlink_to", no_links)
            killing_at(number, patch)
            committed = 0
            try:
                for count in range(1, 4):
                    rows.resize(count, axis=0)
                    rows[-1] = count
                    file.flush()
                    disk.commit()
                    committed = count
                killed = False
            except Killed:
                pass
        if committed and (links or path.exists()):
            with h5py.File(path) as found:
                # After a kill between renaming and the return from it, the commit is already complete.
                count = len(found["rows"])
                assert committed <= count <= committed + 1
                np.testing.assert_array_equal(found["rows"][:, 0], np.arange(1.0, count + 1.0))
        elif committed:
            # Without hard links the file may be missing for a moment; its copy is complete.
            with h5py.File(twin_of(path)) as found:
                assert committed <= len(found["rows"]) <= committed + 1
        file.close()
        disk.close()
    assert number > 15


def test_a_new_file_does_not_replace_an_existing_one(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("content")
    with pytest.raises(FileExistsError):
        CommittedFile(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "content"
