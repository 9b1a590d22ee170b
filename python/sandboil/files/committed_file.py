"""A growing file that can be opened at any moment, also after a kill of the process that wrote it."""

from __future__ import annotations

import io
import os
import shutil
from pathlib import Path

# Unit in which changes are kept, bytes: the page of most memories and disks.
_PAGE = 4096
_NEW = os.O_RDWR | os.O_CREAT | os.O_TRUNC


def twin_of(path: Path) -> Path:
    """The copy beside a committed file, which exists during writing and after a kill."""
    return path.with_name(f".{path.name}.twin")


def sync_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class CommittedFile(io.RawIOBase):
    """A file whose content on disk changes by commits only.

    Data written stay in memory until :meth:`commit`. On disk are two copies: the one with the file's name,
    which is only read, and its twin. A commit updates the twin and exchanges the names. HDF5 writes through
    this object, so a full disk makes the commit fail, and not HDF5.

    Parameters
    ----------
    path : of the file; its folder exists
    exists : whether to continue a file that exists; else there must be none

    Raises :class:`OSError` as files do.
    """

    def __init__(self, path: Path, *, exists: bool = False) -> None:
        super().__init__()
        self._path, self._twin_path = path, twin_of(path)
        # Pages changed since the last commit, and in it: the twin lacks both.
        self._changed: dict[int, bytes] = {}
        self._behind: dict[int, bytes] = {}
        self._position = self._size = 0
        self._committed: int | None = None
        self._twin: int | None = None
        try:
            if exists:
                shutil.copyfile(path, self._twin_path)
                self._committed = os.open(path, os.O_RDWR)
                self._size = os.fstat(self._committed).st_size
            elif path.exists():
                raise FileExistsError(f"{path} exists")
            self._twin = os.open(self._twin_path, os.O_RDWR if exists else _NEW, 0o666)
        except OSError:
            self.close()
            raise

    # Methods that HDF5 calls

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        self._position = start + offset
        return self._position

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        count = max(0, min(len(buffer), self._size - self._position))
        done = 0
        while done < count:
            page, begin = divmod(self._position + done, _PAGE)
            part = self._page(page)[begin : begin + count - done]
            buffer[done : done + len(part)] = part
            done += len(part)
        self._position += count
        return count

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        data, done = memoryview(data).cast("B"), 0
        while done < len(data):
            page, begin = divmod(self._position + done, _PAGE)
            part = bytes(data[done : done + _PAGE - begin])
            done += len(part)
            if len(part) < _PAGE:
                before = self._page(page)
                part = before[:begin] + part + before[begin + len(part) :]
            self._changed[page] = part
        self._position += done
        self._size = max(self._size, self._position)
        return done

    def truncate(self, size: int | None = None) -> int:
        size = self._position if size is None else size
        # Bytes that are cut off are zero when the file grows again.
        for page in range(size // _PAGE, -(-self._size // _PAGE)):
            kept = max(0, size - page * _PAGE)
            self._changed[page] = self._page(page)[:kept].ljust(_PAGE, b"\0")
        self._size = size
        return size

    def _page(self, page: int) -> bytes:
        changed = self._changed.get(page)
        if changed is not None:
            return changed
        if self._committed is None:
            return bytes(_PAGE)
        return os.pread(self._committed, _PAGE, page * _PAGE).ljust(_PAGE, b"\0")

    # Committing

    def commit(self) -> None:
        """Write all changes to the disk. Until the end of this call the file is that of the last commit."""
        assert self._twin is not None
        _write_pages(self._twin, self._behind | self._changed)
        os.ftruncate(self._twin, self._size)
        os.fsync(self._twin)
        if self._committed is None:
            self._twin_path.replace(self._path)
            self._committed = self._twin
            self._twin = os.open(self._twin_path, _NEW, 0o666)
        else:
            self._exchange_names()
            self._committed, self._twin = self._twin, self._committed
        sync_folder(self._path.parent)
        self._behind, self._changed = self._changed, {}

    def _exchange_names(self) -> None:
        """Exchange the names of the copies; the file exists at every moment."""
        self._spare.unlink(missing_ok=True)
        try:
            self._spare.hardlink_to(self._path)
        except OSError:
            # A file system without hard links: for an instant the name is missing, and both copies are whole.
            self._path.replace(self._spare)
        self._twin_path.replace(self._path)
        self._spare.replace(self._twin_path)

    @property
    def _spare(self) -> Path:
        """A third name, used during an exchange."""
        return self._path.with_name(f".{self._path.name}.spare")

    def close(self) -> None:
        """Close the file as it was committed, and remove its twin. A closed file stays as it is."""
        if not self.closed:
            for handle in (self._committed, self._twin):
                if handle is not None:
                    os.close(handle)
            # A twin whose file is missing is the only copy.
            if self._committed is None or self._path.exists():
                self._twin_path.unlink(missing_ok=True)
                self._spare.unlink(missing_ok=True)
        super().close()


def _write_pages(handle: int, pages: dict[int, bytes]) -> None:
    for page in sorted(pages):
        data, at = pages[page], page * _PAGE
        while data:
            count = os.pwrite(handle, data, at)
            data, at = data[count:], at + count
