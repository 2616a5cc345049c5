"""The few exceptions of warpedfoam's own; everything else is ``ValueError`` or ``TypeError``."""

from __future__ import annotations


class WarpedFoamError(Exception):
    """Base of every exception that warpedfoam defines."""


class MeshError(WarpedFoamError, ValueError):
    """A triangle mesh cannot carry geodesics or a foam; the message says where and what to do."""


class TopologyError(WarpedFoamError, ValueError):
    """A cell network breaks a rule, or a move would make it break one."""


class ResolutionError(WarpedFoamError, ValueError):
    """Too few bubbles for the surface, or too few mesh nodes for the bubbles; names the number needed."""


class ConvergenceError(WarpedFoamError, RuntimeError):
    """A computation that must have converged did not."""


class FileFormatError(WarpedFoamError, ValueError):
    """A file is not what its reader expects."""
