"""Small studies for the tests of ensembles, and what of their results must be the same."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import pytest

import warpedfoam as wf

SAME = ("ensemble.csv", "ensemble.parquet")
STUDY: dict[str, Any] = {
    "seed": 2,
    "repeats": 2,
    "surface": {"kind": "sphere", "radius": 1.0},
    "cell": {"gap": 0.01},
    "foam": {"n_bubbles": 16},
    "relax": {"order": 3},
    "grid": {"foam.volumes": [0.0, 0.2]},
    "observables": ("energy", "n_t1", "charges", "defects", "is_minimum"),
}


def study(**changes: Any) -> wf.Study:
    return wf.Study(**{**STUDY, **changes})


def files(folder: Path) -> dict[str, bytes]:
    """Tables and states, byte by byte."""
    paths = [*(folder / name for name in SAME), *folder.glob("states/*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def user_functions(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """A module of the user's in ``folder``, under a name of its own."""
    name = f"user_{folder.name.replace('-', '_')}"
    (folder / f"{name}.py").write_text(textwrap.dedent(text))
    monkeypatch.syspath_prepend(folder)
    return name


def write_study(path: Path, observable: str, repeats: int) -> None:
    path.write_text(
        f'repeats = {repeats}\nobservables = ["mu2", "{observable}"]\n'
        '[surface]\nkind = "sphere"\nradius = 1.0\n[cell]\ngap = 0.01\n[foam]\nn_bubbles = 14\n'
        "[relax]\norder = 3\n"
    )
