"""How commands end: exit codes, one line for a fault, files tidied away on signals."""

from __future__ import annotations

import json
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import Any

import typer

from warpedfoam.cli import CLOSED_PIPE
from warpedfoam.startup import INTERRUPTED, raise_on_interrupt

NOT_CONVERGED, BAD_INPUT, FAULT = 1, 2, 3


class Stopped(BaseException):
    """A signal asked the run to end; raised so that files being written are tidied away."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum


def say(text: str) -> None:
    """A line of our own on stderr; what quotes a long word of the call is cut."""
    line = " ".join(text.split())
    print(f"warpedfoam: {line if len(line) <= 1000 else line[:996] + ' ...'}", file=sys.stderr)


def answer(facts: Mapping[str, Any], text: Callable[[], str], *, as_json: bool, quiet: bool) -> None:
    """The summary on stdout: as one JSON object, as ``text`` or, if it is to be quiet, not at all."""
    if as_json:
        print(json.dumps(facts, allow_nan=False), flush=True)
    elif not quiet:
        print(text(), flush=True)


@contextmanager
def ending_well(debug: bool) -> Iterator[None]:
    """Turn exceptions into one line on stderr and the right exit code."""
    from warpedfoam.errors import ConvergenceError

    try:
        # all that is slow to import, while Ctrl-C still ends the process at once
        import_module("warpedfoam.studies")
        raise_on_interrupt()
        yield
    except KeyboardInterrupt:
        say("interrupted; no file was left half-written")
        raise typer.Exit(INTERRUPTED) from None
    except Stopped as stop:
        say("stopped by a signal; no file was left half-written")
        raise typer.Exit(128 + stop.signum) from None
    except BrokenPipeError:
        # the files are written; that nobody reads the summary is no fault
        raise typer.Exit(CLOSED_PIPE) from None
    except Exception as fault:
        bad = isinstance(fault, (ValueError, TypeError, OSError, ImportError, MemoryError, OverflowError))
        if debug or not (bad or isinstance(fault, ConvergenceError)):
            traceback.print_exc()
        if isinstance(fault, OSError) and fault.strerror and fault.filename:
            say(f"{fault.filename}: {fault.strerror}")
        elif isinstance(fault, (MemoryError, OverflowError)):
            what = (
                "needs more memory than there is"
                if isinstance(fault, MemoryError)
                else "is beyond all numbers"
            )
            say(f"what is asked for {what}; choose smaller sizes or fewer bubbles ({fault})")
        else:
            say(str(fault) or type(fault).__name__)
        code = BAD_INPUT if bad else NOT_CONVERGED if isinstance(fault, ConvergenceError) else FAULT
        raise typer.Exit(code) from None


@contextmanager
def signals() -> Iterator[None]:
    """Raise `Stopped` on SIGTERM and SIGHUP inside the block."""

    def stop(signum: int, _: FrameType | None) -> None:
        raise Stopped(signum)

    names = [s for s in ("SIGTERM", "SIGHUP") if hasattr(signal, s)]
    before = {getattr(signal, s): signal.signal(getattr(signal, s), stop) for s in names}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
