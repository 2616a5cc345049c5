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

from .io_foams import sphere_foam

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


def evolved(
    path: Path, *, refined: int = 0, minimum: bool = True, direct: bool = False
) -> list[wf.EvolverDump]:
    """The Evolver's solutions of a datafile, and after each of its own refinements.

    A ``direct`` way there passes no saddle, and ends within 1e-12.
    """
    dumps = [path.with_suffix(f".{k}.dmp") for k in range(refined + 1)]
    orders = ["m 0"]
    for dump in dumps:
        orders += ["g 1", *["hessian"] * 5, f'dump "{dump}"', "r"]
    done = subprocess.run(
        ["evolver", path],
        input="\n".join([*orders[:-1], "eigenprobe 0", "q", "q", ""]),
        text=True,
        capture_output=True,
        timeout=120,
    )
    said = done.stdout
    # on coarse chords soft motions may be unstable, where they are not in the limit
    assert re.search(r"Eigencounts:\s+0 <", said) or not minimum
    energies = [float(e) for e in re.findall(r"energy:\s+([-\d.eE+]+)", said)]
    assert not direct or "not positive" not in done.stdout + done.stderr
    for end in range(5, len(energies), 6):
        assert energies[end] == pytest.approx(energies[end - 1], rel=1e-12 if direct else 1e-11)
    return [wf.read_dmp(dump) for dump in dumps]


@live
@pytest.mark.parametrize(("kind", "n"), [("sphere", 12), ("torus", 12), ("sphere", 50), ("torus", 50)])
def test_the_evolver_agrees(tmp_path: Path, kind: str, n: int) -> None:
    foam = wf.load(DATA / f"{kind}_{n}.npz")
    dumps = [evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s), direct=True)[0] for s in (4, 8, 16)]
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
        evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s, model="string"), direct=True)[0].energy
        for s in (4, 8)
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


# ------------------------------------------------------------------ other surfaces, clusters


SURFACES = {
    "flat torus": (wf.FlatTorus(4.0, 3.0), 12, 2, 1),
    "cylinder": (wf.Cylinder(1.0, 2.0), 14, 2, 1),
    "joined cylinder": (wf.Cylinder(1.0, 3.0, periodic=True), 16, 2, 1),
    "catenoid": (wf.Catenoid(1.0, 1.5), 14, 2, 1),
    "spheroid": (wf.Ellipsoid(0.7, 0.7, 2.0), 16, 2, 3),
}


def relaxed_on(surface: wf.surfaces.Surface, n: int, seed: int, lloyd: int) -> wf.Foam:
    found = wf.relax(wf.voronoi_foam(wf.HeleShawCell(surface, 0.1), n, seed=seed, lloyd=lloyd), order=8)
    assert found.is_minimum
    return found.foam


@live
@pytest.mark.parametrize("name", SURFACES)
def test_the_evolver_agrees_on_other_surfaces(tmp_path: Path, name: str) -> None:
    """Rims, joined sides, volumes by rays and by angles."""
    foam = relaxed_on(*SURFACES[name])
    levels = (4, 8, 16) if name in ("flat torus", "cylinder") else (4, 8)
    dumps = [evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s), minimum=s > 4)[0] for s in levels]
    energies = [d.energy for d in dumps]
    if len(levels) == 3:
        agree(foam, energies, [d.bubble_pressures(foam) for d in dumps])
    # what the limit misses is of the fourth order
    assert abs(extrapolated(*energies[:2]) - foam.energy) < 0.01 * abs(energies[1] - energies[0])


def volumes_of(path: Path, count: int) -> np.ndarray:
    """Volumes that the Evolver finds in a datafile as it is, over those wanted."""
    done = subprocess.run(
        ["evolver", path],
        input="m 0\nshow_all_quantities\nQ\nq\nq\n",
        text=True,
        capture_output=True,
        timeout=60,
    )
    found = re.findall(r"bubble_\d+ +([-\d.eE+]+) +fixed[^\n]*\n +target +([-\d.eE+]+)", done.stdout)
    assert len(found) == count
    a, b = np.array(found, dtype=float).T
    return a / b


#: Without a formula of the outer plate, or with slow ones: string model only.
STRINGS = ("spheroid", "catenoid", "ellipsoid")
PLACES = {name: surface for name, (surface, *_) in SURFACES.items()} | {
    "torus": wf.Torus(2.0, 1.0),
    "ellipsoid": wf.Ellipsoid(1.0, 1.3, 0.8),
}
VOLUMES = [(name, "ruled") for name in PLACES] + [
    (name, "soapfilm") for name in PLACES if name not in STRINGS
]


@live
@pytest.mark.parametrize(("name", "model"), VOLUMES)
def test_volumes_of_every_form(tmp_path: Path, name: str, model: str) -> None:
    """Those of chords tend to ours with the second order, those of curved triangles with the fourth."""
    raw = wf.voronoi_foam(wf.HeleShawCell(PLACES[name], 0.2), 16, seed=2, lloyd=2)
    whole = raw.bubble_volumes.sum() / raw.cell.volume
    foam = wf.Foam(raw.cell, raw.network, raw.vertex_points, raw.film_offsets, raw.bubble_volumes / whole)
    power = 4.0 if model == "soapfilm" else 2.0
    off = [
        volumes_of(wf.write_fe(tmp_path / f"{s}.fe", foam, model=model, segments=s), 15) - 1.0 for s in (4, 8)
    ]
    coarse = np.abs(off[0]).max()
    assert coarse < {"ruled": 0.05, "soapfilm": 5e-3}[model]
    assert np.abs(off[1] - off[0] / 2.0**power).max() < 0.05 * coarse + 4.0 * abs(whole - 1.0) + 2e-9


@live
def test_clusters_have_an_exterior(tmp_path: Path) -> None:
    cell = wf.HeleShawCell(wf.Sphere(2.0), 0.1)
    found = wf.relax(wf.cluster_foam(cell, 4, volumes=0.02 * cell.volume), order=8)
    foam = found.foam
    assert foam.exterior is not None
    assert found.converged
    dumps = [evolved(wf.write_fe(tmp_path / f"{s}.fe", foam, segments=s))[0] for s in (4, 8, 16)]
    energies = [d.energy for d in dumps]
    limit = extrapolated(*energies[1:])
    assert abs(limit - foam.energy) < abs(limit - extrapolated(*energies[:2]))
    pressures = extrapolated(*(d.bubble_pressures(foam) for d in dumps[1:]))
    assert pressures[foam.exterior] == 0.0
    np.testing.assert_allclose(pressures, foam.pressures, rtol=1e-4)


# ------------------------------------------------------------------ films that bulge


@live
def test_bulging_films_on_a_sphere(tmp_path: Path) -> None:
    """After the Evolver's own refinement it has the energy of layered films, and not that of ruled ones."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.3)
    ours = wf.relax(wf.voronoi_foam(cell, 8, seed=1, lloyd=3), order=10, layers=4)
    assert isinstance(ours, wf.LayeredRelaxation)
    path = wf.write_fe(tmp_path / "f.fe", ours.foam, model="soapfilm", segments=4)
    dumps = evolved(path, refined=1)
    step = dumps[1].energy - dumps[0].energy
    limit = dumps[1].energy + step / 15.0
    error = 0.1 * abs(step) / 15.0
    assert abs(limit - ours.energy) < error < 0.25 * (ours.ruled_energy - ours.energy)
    pressures = [d.bubble_pressures(ours.foam) for d in dumps]
    change = np.abs(pressures[1] - pressures[0]).max()
    np.testing.assert_allclose(
        pressures[1] + (pressures[1] - pressures[0]) / 15.0, ours.pressures, atol=change
    )


def belts() -> wf.Foam:
    """Two bubbles that share a torus, each half of its ring."""
    k = np.arange(12)
    film, back = k >> 1, k & 1
    loop, place = film // 3, film % 3
    following = 2 * (3 * loop + (place + np.where(back, -1, 1)) % 3) + back
    origin = 3 * loop + (place + back) % 3
    torus = wf.Torus(2.0, 1.0)
    points = torus.points(2.0 * np.pi / 3.0 * np.tile(np.arange(3), 2), np.repeat([0.0, np.pi], 3))
    cell = wf.HeleShawCell(torus, 0.1)
    halves = np.full(2, 0.5 * cell.volume)
    network = wf.CellNetwork(following, origin, (loop + back + 1) % 2, [0, 0])
    return wf.Foam(cell, network, points, np.zeros((6, 3)), halves)


def test_refusals(tmp_path: Path) -> None:
    hill = wf.Graph(lambda x: 0.1 * x[:, 0] ** 2, lambda x: 0.2 * x * [1.0, 0.0], 2.0, 2.0)
    with pytest.raises(ValueError, match="Sphere or Torus, got Graph"):
        wf.write_fe(tmp_path / "f.fe", wf.voronoi_foam(wf.HeleShawCell(hill, 0.1), 12, seed=1))
    egg = wf.voronoi_foam(wf.HeleShawCell(wf.Ellipsoid(1.0, 1.1, 1.2), 0.1), 16, seed=1)
    with pytest.raises(ValueError, match=r"formula of the outer plate.*Ellipsoid"):
        wf.write_fe(tmp_path / "f.fe", egg, model="soapfilm")
    with pytest.raises(ValueError, match="bubble 0 is none"):
        wf.write_fe(tmp_path / "f.fe", belts())
    for options in ({"model": "film"}, {"segments": 0}, {"layers": 0}):
        with pytest.raises(ValueError, match=r"model|segments|layers"):
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
