"""What every reader does first: the file is there, is a file, and its extra package is installed."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from warpedfoam.errors import FileFormatError


def existing(source: Path) -> Path:
    """The path, if a file is there.

    Raises
    ------
    FileNotFoundError
        If nothing is there.
    FileFormatError
        If it is no file.
    """
    if not source.exists():
        raise FileNotFoundError(f"cannot read {source}: there is no such file")
    if not source.is_file():
        raise FileFormatError(f"cannot read {source}: it is not a file")
    return source


def text_of(source: Path) -> str:
    """The whole file as UTF-8 text.

    Raises
    ------
    FileNotFoundError, FileFormatError
        If it is not there or is no text.
    """
    try:
        return existing(source).read_bytes().decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise FileFormatError(f"cannot read {source}: it is no text") from None


def brief(fault: object) -> str:
    r"""What a fault says, in one line that is not too long: it may quote the file.

    Examples
    --------
    >>> brief(ValueError("unknown\n" + 500 * "9"))[-12:]
    '99999999 ...'
    """
    text = " ".join(str(fault).split())
    return text if len(text) <= 240 else f"{text[:236]} ..."


def extra(module: str, purpose: str) -> ModuleType:
    """Import a package of the extra ``formats``.

    Raises
    ------
    ImportError
        If it is not installed; says what to install.
    """
    try:
        return importlib.import_module(module)
    except ImportError as fault:
        name = module.split(".")[0]
        raise ImportError(
            f'{purpose} needs {name}, which is not installed: pip install "warpedfoam[formats]"', name=name
        ) from fault
