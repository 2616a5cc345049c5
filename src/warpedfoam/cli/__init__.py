"""The command line: ``warpedfoam run foam.toml`` and ``warpedfoam foam torus``."""

from __future__ import annotations

import os
import sys

from warpedfoam.startup import INTERRUPTED, quit_on_interrupt

#: As if SIGPIPE had ended it, which is how other commands end when nobody reads on.
CLOSED_PIPE = 141


def main() -> int:
    """Run the command line; the entry point of the ``warpedfoam`` command.

    Returns
    -------
    int
        0 done and converged, 1 not converged, 2 bad input, 3 a fault of warpedfoam's own, 130 interrupted,
        141 if the reader of its output has gone.
    """
    quit_on_interrupt()
    try:
        code = _run_app()
        quit_on_interrupt()  # all is done or tidied away: an impatient second Ctrl-C shows nothing either
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        print("warpedfoam: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _drop_output()
        return CLOSED_PIPE
    return code


def _run_app() -> int:
    from warpedfoam.cli.app import app

    try:
        app(prog_name="warpedfoam")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def _drop_output() -> None:
    """Send what is left for stdout nowhere; Python writes it on leaving and would complain again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
