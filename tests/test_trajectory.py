"""HDF5 trajectories: bit for bit, with topology that changes, and safe from a killed writer."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import warpedfoam as wf

from .io_foams import bubble_on_torus, sphere_foam, torus_foam, with_pressures
from .test_io_files import _same

ROOT = Path(__file__).parents[1]


def written(path: Path, foams: list[wf.Foam]) -> Path:
    with wf.TrajectoryWriter(path) as writer:
        for k, foam in enumerate(foams):
            writer.append(foam, time=0.5 * k)
    return path


def test_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    foams = [with_pressures(sphere_foam(30)), sphere_foam(12), sphere_foam(20).with_order(2), sphere_foam(40)]
    one_cell = [
        foams[0],
        *(wf.Foam(foams[0].cell, f.network, f.vertex_points, f.film_offsets) for f in foams[1:]),
    ]
    with wf.Trajectory(written(tmp_path / "run.h5", one_cell)) as frames:
        assert frames.times.tolist() == [0.0, 0.5, 1.0, 1.5]
        assert all(_same(a, b) and a.energy == b.energy for a, b in zip(frames, one_cell, strict=True))
        assert _same(frames[-1], one_cell[-1])
        with pytest.raises((IndexError, ValueError)):
            frames[4]


@pytest.mark.parametrize("make", [torus_foam, bubble_on_torus])
def test_other_surfaces(tmp_path: Path, make) -> None:
    foam = make()
    assert _same(wf.Trajectory(written(tmp_path / "run.h5", [foam]))[0], foam)


def test_a_surface_of_arrays_is_stored_once(tmp_path: Path) -> None:
    mesh, ball = wf.Sphere(2.0).triangulate(300), sphere_foam(12)
    cell = wf.HeleShawCell(wf.MeshSurface(mesh.nodes, mesh.triangles), gap=0.02)
    loops = np.split(ball.network.origin[ball.network.loops.halves], ball.network.loops.starts[1:])
    foam = wf.import_polygons((ball.vertex_points, loops), cell)
    path = written(tmp_path / "run.h5", [foam] * 3)
    assert _same_arrays(wf.Trajectory(path)[2], foam)
    with h5py.File(path) as file:
        assert len(file["cell"]) == 2


def _same_arrays(a: wf.Foam, b: wf.Foam) -> bool:
    return a.vertex_points.tobytes() == b.vertex_points.tobytes() and a.energy == b.energy


def test_h5py_and_pandas_read_the_schema(tmp_path: Path) -> None:
    foams = [sphere_foam(12), sphere_foam(20)]
    with h5py.File(written(tmp_path / "run.h5", foams)) as file:
        assert (file.attrs["format"], file.attrs["version"]) == ("warpedfoam trajectory", 1)
        columns = file["index"].attrs["columns"].split(", ")
        table = pd.DataFrame(file["index"][()], columns=columns)
        ends = table["end of vertex_points"].to_numpy()
        assert ends.tolist() == [3 * 20, 3 * (20 + 36)]
        points = file["vertex_points"][ends[0] : ends[1]].reshape(-1, 3)
        np.testing.assert_array_equal(points, foams[1].vertex_points)
        assert file["time"][()].tolist() == [0.0, 0.5]


def test_goes_on_with_what_is_there(tmp_path: Path) -> None:
    foam = sphere_foam(12)
    path = written(tmp_path / "run.h5", [foam, foam])
    with pytest.raises(FileExistsError, match="append=True"):
        wf.TrajectoryWriter(path)
    with wf.TrajectoryWriter(path, append=True) as writer:
        writer.append(sphere_foam(20))
        with pytest.raises(ValueError, match="time must rise"):
            writer.append(foam, time=0.1)
        with pytest.raises(ValueError, match="must lie in the cell"):
            writer.append(torus_foam())
    frames = wf.Trajectory(path)
    assert frames.times.tolist() == [0.0, 0.5, 1.5]
    assert [f.n_bubbles for f in frames] == [12, 12, 20]
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_refuses_what_it_does_not_know(tmp_path: Path) -> None:
    from warpedfoam.io.hdf5_superblock import seal

    path = written(tmp_path / "run.h5", [sphere_foam(12)])
    for change, words in (
        (lambda f: f.attrs.modify("version", 2), "version 2"),
        (lambda f: f.attrs.modify("format", "other"), "no trajectory"),
        (lambda f: f.__delitem__("bubble"), "lacks bubble"),
        (lambda f: f.attrs.modify("cell", "{}"), "checksum of its cell"),
        (lambda f: f["vertex_points"].__setitem__(0, 0.25), "checksum"),
    ):
        other = tmp_path / "other.h5"
        other.write_bytes(path.read_bytes())
        with h5py.File(other, "r+") as file:
            change(file)
        with pytest.raises(wf.FileFormatError, match="checksum is wrong"):
            list(wf.Trajectory(other))
        seal(other)
        with pytest.raises(wf.FileFormatError, match=words):
            list(wf.Trajectory(other))
    (tmp_path / "other.h5").write_bytes(b"")
    with pytest.raises(wf.FileFormatError, match="no trajectory"):
        wf.Trajectory(tmp_path / "other.h5")
    with h5py.File(tmp_path / "plain.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(wf.FileFormatError, match="no trajectory"):
        wf.Trajectory(tmp_path / "plain.h5")


WRITER = """
import sys
import warpedfoam as wf
from tests.io_foams import sphere_foam
foams = [sphere_foam(12), sphere_foam(20)]
writer = wf.TrajectoryWriter(sys.argv[1])
k = 0
while True:
    writer.append(foams[k % 2])
    k += 1
    print(k, flush=True)
"""


@pytest.mark.parametrize("wait", [0.0, 0.013, 0.05, 0.2])
def test_a_killed_writer_loses_no_frame(tmp_path: Path, wait: float) -> None:
    path = tmp_path / "run.h5"
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "1\n"
    time.sleep(wait)
    if wait > 0.1:  # readers do not wait for the writer
        assert len(wf.Trajectory(path)) >= 1
    process.kill()
    told = process.stdout.read().split()
    process.wait()
    process.stdout.close()
    finished = int(told[-1]) if told else 1
    with wf.Trajectory(path) as frames:
        assert finished <= len(frames) <= finished + 1
        assert all(_same(f, sphere_foam(20 if k % 2 else 12)) for k, f in enumerate(frames))
    with wf.TrajectoryWriter(path, append=True) as writer:
        writer.append(sphere_foam(12))
    with h5py.File(path) as file:  # sound for everyone again
        assert len(file["time"]) in (finished + 1, finished + 2)
