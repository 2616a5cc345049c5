"""The command line: ``warpedfoam run foam.toml`` and ``warpedfoam foam torus``."""

from __future__ import annotations


def main() -> int:
    """Run the command line; the entry point of the ``warpedfoam`` command.

    Returns
    -------
    int
        0 done and converged, 1 not converged, 2 bad input, 3 a fault of warpedfoam's own, 130 interrupted.
    """
    import sys

    try:
        from warpedfoam.cli.app import app

        app(prog_name="warpedfoam")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        print("warpedfoam: interrupted", file=sys.stderr)
        return 130
    return 0
