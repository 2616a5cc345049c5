"""Doctests are looked for in every module; one needs a package that may be missing."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("pypardiso") else ["src/warpedfoam/relax/pardiso.py"]
