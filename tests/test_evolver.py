"""Against the Surface Evolver: live where the program is, by its recorded answers everywhere.

``tests/data/evolver`` is made by ``python benchmarks/against_evolver.py --record tests/data/evolver``.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .io_foams import bubble_on_torus, sphere_foam

DATA = Path(__file__).parent / "data" / "evolver"
FOAMS = [(kind, n) for kind in ("sphere", "torus") for n in (12, 50, 200)]
# CI sets this, so that a missing program is a failure there
NEEDED = os.environ.get("WARPEDFOAM_EVOLVER") == "1"
live = pytest.mark.skipif(
    shutil.which("evolver") is None and not NEEDED,
    reason="the Surface Evolver is not installed (Debian: evolver-nox)",
)


def extrapolated(coarse, fine):
    return (4.0 * np.asarray(fine) - np.asarray(coarse)) / 3.0


def agree(foam: wf.Foam, energies: list[float], pressures: list) -> None:
    """Three levels, each of half the chords' length: order 2, and the same limit within its error."""
    ours = wf.relax(foam, t1=False)
    assert ours.converged
    steps = np.diff(energies)
    assert 3.7 < steps[0] / steps[1] < 4.3
    limits = [extrapolated(*pair) for pair in itertools.pairwise(energies)]
    error = abs(limits[1] - limits[0])
    assert abs(limits[1] - ours.energy) < error
    assert error < 4e-5 * ours.energy
    spread = np.ptp(ours.pressures)
    limits = [extrapolated(*pair) for pair in itertools.pairwise(pressures)]
    error = np.abs(limits[1] - limits[0]).max()
    assert np.abs(limits[1] - ours.pressures).max() < error < 1e-2 * spread


@pytest.mark.parametrize(("kind", "n"), FOAMS)
def test_energy_and_pressures_are_those_recorded(kind: str, n: int) -> None:
    told = json.loads((DATA / f"{kind}_{n}.json").read_text())
    assert all(told["minimum"])
    agree(wf.load(DATA / f"{kind}_{n}.npz"), told["energies"], told["pressures"])


def evolved(path: Path) -> wf.EvolverDump:
    dump = path.with_suffix(".dmp")
    orders = ["m 0", "g 1", *["hessian"] * 5, f'dump "{dump}"', "q", "q", ""]
    done = subprocess.run(
        ["evolver", path], input="\n".join(orders), text=True, capture_output=True, timeout=120
    )
    assert "not positive" not in done.stdout + done.stderr
    energies = [float(e) for e in re.findall(r"energy:\s+([-\d.eE+]+)", done.stdout)]
    assert energies[-1] == pytest.approx(energies[-2], rel=1e-12)
    return wf.read_dmp(dump)


@live
@pytest.mark.parametrize(("kind", "n"), [("sphere", 12), ("torus", 12), ("sphere", 50), ("torus", 50)])
def test_the_evolver_agrees(tmp_path: Path, kind: str, n: int) -> None:
    foam = wf.load(DATA / f"{kind}_{n}.npz")
    dumps = [evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s)) for s in (4, 8, 16)]
    agree(foam, [d.energy for d in dumps], [d.bubble_pressures(foam) for d in dumps])
    told = json.loads((DATA / f"{kind}_{n}.json").read_text())
    np.testing.assert_allclose([d.energy for d in dumps], told["energies"], rtol=1e-10)


@live
def test_the_evolver_finds_the_dodecahedron(tmp_path: Path) -> None:
    """Leading order: γ d times 21.8918297, the geodesic net's length."""
    t = 0.5 * (1.0 + 5.0**0.5)
    corners = [(0.0, a, b * t) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    seeds = np.array([np.roll(c, k) for c in corners for k in range(3)]) / np.hypot(1.0, t)
    foam = wf.relax(wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(1.0), gap=1e-3), seeds=seeds)).foam
    energies = [
        evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s, model="string")).energy for s in (4, 8)
    ]
    assert set(foam.network.sides.tolist()) == {5}
    assert extrapolated(*energies) / 1e-3 == pytest.approx(21.89182969, rel=2e-7)


@live
def test_dumps_hold_what_was_written(tmp_path: Path) -> None:
    foam = wf.load(DATA / "torus_12.npz")
    path = wf.write_fe(tmp_path / "f.fe", foam, segments=2)
    subprocess.run(
        ["evolver", path],
        input=f'dump "{tmp_path}/f.dmp"\nq\nq\n',
        text=True,
        capture_output=True,
        timeout=60,
    )
    dump = wf.read_dmp(tmp_path / "f.dmp")
    assert dump.points.shape == (foam.network.n_vertices + foam.network.n_films, 3)
    assert dump.edges.shape == (2 * foam.network.n_films, 2)
    np.testing.assert_allclose(dump.points[: foam.network.n_vertices], foam.vertex_points, atol=1e-12)
    np.testing.assert_array_equal(dump.edges[::2, 0], foam.network.tails)
    assert list(dump.targets.values()) == pytest.approx(foam.target_volumes[:-1].tolist(), rel=1e-13)


def test_dump() -> None:
    dump = wf.read_dmp(DATA / "sphere_12.dmp")
    foam = wf.load(DATA / "sphere_12.npz")
    assert dump.energy == pytest.approx(json.loads((DATA / "sphere_12.json").read_text())["energies"][0])
    assert len(dump.points) == foam.network.n_vertices + 3 * foam.network.n_films
    np.testing.assert_allclose(np.linalg.norm(dump.points, axis=1), 1.0, atol=1e-12)
    assert dump.bubble_pressures(foam).sum() == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValueError, match="holds 11 volumes"):
        dump.bubble_pressures(sphere_foam(20))


def test_refusals(tmp_path: Path) -> None:
    flat = wf.voronoi_foam(wf.HeleShawCell(wf.FlatTorus(4.0, 3.0), 0.1), 20, seed=1)
    with pytest.raises(ValueError, match="Sphere or a Torus, got FlatTorus"):
        wf.write_fe(tmp_path / "f.fe", flat)
    with pytest.raises(ValueError, match="bubble 1 is none"):
        wf.write_fe(tmp_path / "f.fe", bubble_on_torus())
    for options in ({"model": "film"}, {"segments": 0}):
        with pytest.raises(ValueError, match=r"model|segments"):
            wf.write_fe(tmp_path / "f.fe", sphere_foam(12), **options)
    assert not list(tmp_path.iterdir())
    whole = (DATA / "sphere_12.dmp").read_text()
    for text, words in (
        ("", "no total energy"),
        (whole[: len(whole) // 2], "no section"),
        (whole.replace("\n  5 ", "\n  4 ", 1), "different"),
        (re.sub(r"(\n  5  +)\S+", r"\1nan", whole, count=1), "3 numbers"),
    ):
        (tmp_path / "f.dmp").write_text(text)
        with pytest.raises(wf.FileFormatError, match=words):
            wf.read_dmp(tmp_path / "f.dmp")
