"""Bad calls through the front door: the right exception, a message that says what to do, no crash."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from . import bad_bubbles, bad_foams, bad_gaps, bad_geometry  # noqa: F401 - they fill the table
from .bad_calls import BAD, SPHERE, Bad, cell, changed

ROOT = Path(__file__).parents[1]


def test_the_table_is_long_and_its_names_differ():
    assert len(BAD) >= 60
    assert len({row.name for row in BAD}) > 0.9 * len(BAD)


@pytest.mark.parametrize("row", BAD, ids=[row.name for row in BAD])
def test_bad_calls_say_what_is_wrong(row: Bad, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(row.fault, match=row.says) as caught:
        row.call()
    kinds = (ValueError, TypeError, OSError, wf.WarpedFoamError)
    assert type(caught.value) in {row.fault, *wf.WarpedFoamError.__subclasses__()}
    assert isinstance(caught.value, kinds)
    assert list(tmp_path.iterdir()) == []  # nothing half-written


SURVIVAL = """
import warnings
warnings.simplefilter("error")
from tests import bad_bubbles, bad_calls, bad_foams, bad_gaps, bad_geometry
refused = 0
for row in bad_calls.BAD:
    try:
        row.call()
    except row.fault:
        refused += 1
relaxed = bad_calls.wf.relax(bad_calls.foam())
print(refused, len(bad_calls.BAD), relaxed.converged)
"""


def test_one_interpreter_survives_them_all_and_works_on(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SURVIVAL],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(wf.__file__).parents[1])])},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split() == [str(len(BAD)), str(len(BAD)), "True"]


# ---------------------------------------------------------------------------- found by attack, mended


@pytest.mark.parametrize("radius", [1e-200, 1e200])
def test_sizes_beyond_floating_point_are_refused_by_name(radius):
    with pytest.raises(ValueError, match="radius"):
        wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(radius), gap=0.1 * radius), 20, seeds="lattice")


@pytest.mark.parametrize(
    "call",
    [
        lambda: wf.HeleShawCell(SPHERE, 0.1, n_heights=1000),
        lambda: wf.Foam.from_loops(cell(), np.eye(3), [(0, 1, 2), (2, 1, 0)], order=100),
    ],
    ids=["n_heights", "from_loops"],
)
def test_enormous_orders_are_refused(call):
    with pytest.raises(ValueError, match="must be at most"):
        call()


def test_bubbles_inside_out_are_refused_with_targets_too():
    corners, loops = (
        [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]],
        [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)],
    )
    with pytest.raises(ValueError, match="counter-clockwise"):
        wf.Foam.from_loops(cell(), corners, loops, target_volumes=np.full(4, cell().volume / 4))


def test_a_surface_covered_twice_is_refused():
    torus = wf.HeleShawCell(wf.Torus(3.0, 1.0), 0.1)
    one = wf.voronoi_foam(torus, 60, seeds="lattice", n_nodes=2000)
    net = one.network
    network = wf.CellNetwork(
        np.concatenate([net.next, net.next + len(net.next)]),
        np.concatenate([net.origin, net.origin + net.n_vertices]),
        np.concatenate([net.bubble, net.bubble + net.n_bubbles]),
    )
    places = np.concatenate([one.vertex_points, one.vertex_points])
    with pytest.raises(ValueError, match=r"twice|volume|pieces"):
        wf.Foam(torus, network, places, target_volumes=np.full(120, torus.volume / 120))


@pytest.mark.parametrize("surface", [wf.Sphere(1.0), wf.Torus(3.0, 1.0)], ids=["sphere", "torus"])
def test_a_film_without_length_is_reported_without_warnings(surface):
    start = wf.voronoi_foam(wf.HeleShawCell(surface, 0.1), 60, seeds="lattice", n_nodes=2000)
    places = changed(start.vertex_points, start.network.heads[0], start.vertex_points[start.network.tails[0]])
    crushed = wf.Foam(
        start.cell, start.network, places, start.film_offsets, target_volumes=start.target_volumes
    )
    assert wf.relax(crushed).message


def test_two_hemispheres_have_centres_and_tables(tmp_path):
    angle = 2 * np.pi * np.arange(3) / 3
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    halves = wf.Foam.from_loops(cell(), rim, [(0, 1, 2), (0, 2, 1)])
    np.testing.assert_allclose(halves.bubble_centres, [[0, 0, 1], [0, 0, -1]], atol=1e-9)
    wf.write_bubbles_csv(tmp_path / "bubbles.csv", halves)
