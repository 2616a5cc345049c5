"""Ctrl-C while the command is still importing ends it quietly.

Imported first of all; in programs that import warpedfoam it does nothing. An exception in the middle of
an import would show a traceback, some packages make an ``ImportError`` of it, and there is nothing to
tidy away yet.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

INTERRUPTED = 130


def quit_on_interrupt() -> None:
    """Let SIGINT end the process with 130 and one line, unless someone else takes or ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with suppress(ValueError):  # in another than the main thread, which alone may do this
            signal.signal(signal.SIGINT, _quit)


def raise_on_interrupt() -> None:
    """Let SIGINT raise ``KeyboardInterrupt`` again: from here on files are tidied away."""
    if signal.getsignal(signal.SIGINT) is _quit:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def is_command() -> bool:
    """Tell whether this process is the ``warpedfoam`` command or ``python -m warpedfoam.cli``."""
    name = sys.argv[0] if sys.argv else ""
    if name == "-m":  # so called while Python looks for the module that is to be run
        return any(argument.endswith("warpedfoam.cli") for argument in sys.orig_argv)
    return os.path.basename(name).lower() in ("warpedfoam", "warpedfoam.exe")


def _quit(_: int, __: FrameType | None) -> None:
    # no exit handlers: they belong to packages that are half imported
    os.write(2, b"warpedfoam: interrupted\n")
    os._exit(INTERRUPTED)


if is_command():
    quit_on_interrupt()
