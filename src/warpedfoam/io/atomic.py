"""Files appear whole or not at all: write beside the target, then rename."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO, TextIO, cast

PathLike = str | os.PathLike[str]


def as_path(path: object, name: str = "path") -> Path:
    """Return ``path`` as a `pathlib.Path`.

    Raises
    ------
    TypeError
        If it is neither a string nor a path.
    ValueError
        If it is empty or holds a null character.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"{name} must be a string or a pathlib.Path, got {type(path).__name__}")
    text = os.fspath(path)
    if not isinstance(text, str):
        raise TypeError(f"{name} must be text, got {type(text).__name__}; decode it first (os.fsdecode)")
    if not text or "\0" in text:
        raise ValueError(f"{name} must name a file, got {text!r}")
    return Path(text)


def writable_path(path: object, *, suffixes: tuple[str, ...] = ()) -> Path:
    """Return ``path`` if a file can be put there.

    Raises
    ------
    FileNotFoundError
        If its folder does not exist.
    IsADirectoryError
        If it is a folder itself.
    ValueError
        If it is a device or another special file, its folder is a file, or its ending is none of
        ``suffixes``.
    """
    target = as_path(path)
    if suffixes and target.suffix.lower() not in suffixes:
        raise ValueError(f"the file name must end in {' or '.join(suffixes)}, got {target.name!r}")
    folder = target.parent
    if not folder.exists():
        raise FileNotFoundError(f"cannot write {target}: there is no folder {folder}; make it first")
    if not folder.is_dir():
        raise ValueError(f"cannot write {target}: {folder} is a file, not a folder")
    if target.is_dir():
        raise IsADirectoryError(f"cannot write {target}: it is a folder; add a file name")
    if target.exists() and not target.is_file():
        raise ValueError(f"cannot write {target}: it is not a regular file; choose another name")
    return target


@contextmanager
def atomic_text(path: PathLike) -> Iterator[TextIO]:
    """Open ``path`` for UTF-8 text that replaces it only if the block ends without an exception.

    Line ends are written as they are given.

    Raises
    ------
    FileNotFoundError, IsADirectoryError, ValueError
        As `writable_path`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name) / "note.txt"
    >>> with atomic_text(path) as stream:
    ...     _ = stream.write("whole or not at all")
    >>> path.read_text()
    'whole or not at all'
    >>> folder.cleanup()
    """
    with _replacing(writable_path(path), "w") as stream:
        yield cast(TextIO, stream)


@contextmanager
def atomic_binary(path: PathLike) -> Iterator[BinaryIO]:
    """Open ``path`` for bytes that replace it only if the block ends without an exception.

    Raises
    ------
    FileNotFoundError, IsADirectoryError, ValueError
        As `writable_path`.
    """
    with _replacing(writable_path(path), "wb") as stream:
        yield cast(BinaryIO, stream)


def room_for(path: Path, count: int) -> None:
    """Let the disk say now, not in the middle of a file, that it does not take ``count`` bytes more.

    Raises
    ------
    OSError
        If it is full.
    """
    try:
        if not hasattr(os, "posix_fallocate"):
            if shutil.disk_usage(path.parent).free < count:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return
        temporary = _beside(path)
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            os.posix_fallocate(descriptor, 0, count)
        finally:
            os.close(descriptor)
            temporary.unlink(missing_ok=True)
    except OSError as fault:
        raise named(fault, path) from None


def _beside(target: Path) -> Path:
    """A name for a temporary file in the same folder."""
    return target.with_name(f".{target.name[:200]}.{secrets.token_hex(6)}.part")


def named(fault: BaseException, target: Path) -> BaseException:
    """The fault; one of the system's that names no file or a temporary one, with the file's name."""
    other = isinstance(fault, OSError) and (fault.filename is None or str(fault.filename).endswith(".part"))
    if isinstance(fault, OSError) and fault.errno is not None and other:
        return OSError(fault.errno, fault.strerror, str(target)).with_traceback(fault.__traceback__)
    return fault


@contextmanager
def _replacing(target: Path, mode: str) -> Iterator[IO[str] | IO[bytes]]:
    target = target.resolve()  # through a link, so that the link stays one
    temporary = _beside(target)
    # os.open rather than tempfile: the file gets the permissions of any new file here
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(temporary, flags, 0o666)
    except OSError as fault:
        raise named(fault, target) from None
    try:
        text = mode == "w"
        with open(
            descriptor, mode, encoding="utf-8" if text else None, newline="" if text else None
        ) as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except BaseException as fault:  # KeyboardInterrupt too: no litter
        temporary.unlink(missing_ok=True)
        raise named(fault, target) from None
