"""Disks that are full or read-only, names as people give them, readers beside a writer."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam import plot
from warpedfoam.io import write_mesh

from .io_foams import sphere_foam, with_pressures
from .test_io_files import _same

ROOT = Path(__file__).parents[1]
SMALL, LARGE = sphere_foam(12), with_pressures(sphere_foam(30))
Writer = Callable[[Path, wf.Foam], object]
WRITERS: dict[str, Writer] = {
    ".npz": wf.save,
    ".vtp": wf.write_vtp,
    ".vtm": wf.write_vtm,
    ".pvd": lambda path, foam: wf.write_pvd(path, [foam]),
    ".ply": wf.write_ply,
    ".obj": wf.write_obj,
    ".glb": wf.write_glb,
    ".graphml": wf.write_graphml,
    ".json": wf.write_graph_json,
    ".csv": wf.write_bubbles_csv,
    ".parquet": wf.write_bubbles_parquet,
    ".fe": wf.write_fe,
    ".html": wf.write_view,
    ".svg": lambda path, foam: plot.save_picture(path, foam),
    "_mesh.ply": lambda path, foam: write_mesh(path, foam.cell.surface.triangulate(12 * foam.n_bubbles)),
}
posix = pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@posix
@pytest.mark.parametrize("ending", WRITERS)
def test_no_room_leaves_the_old_file_whole(tmp_path: Path, ending: str) -> None:
    """A limit on the size of files, which the system enforces as it does a full disk."""
    import resource

    path = tmp_path / f"foam{ending}"
    WRITERS[ending](path, SMALL)
    before = contents(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large") as caught:
            WRITERS[ending](path, LARGE)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.filename is not None
    assert str(caught.value.filename).startswith(str(tmp_path / "foam"))
    assert not str(caught.value.filename).endswith(".part")
    assert contents(tmp_path) == before
    WRITERS[ending](path, LARGE)
    assert contents(tmp_path) != before


@pytest.mark.parametrize("ending", [".npz", ".vtp", ".glb", ".csv"])
def test_a_disk_that_may_not_be_written(tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(path: object, *_: object) -> int:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    path = tmp_path / f"foam{ending}"
    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(OSError, match="Read-only") as caught:
        WRITERS[ending](path, SMALL)
    monkeypatch.undo()
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []


class TestTrajectory:
    def test_a_full_disk_is_known_before_hdf5_sees_it(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(*_: object) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        with wf.TrajectoryWriter(tmp_path / "run.h5") as writer:
            writer.append(SMALL)
            monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
            for _ in range(2):
                with pytest.raises(OSError, match=r"No space .*run\.h5"):
                    writer.append(SMALL)
            monkeypatch.undo()
            writer.append(SMALL)
        assert [_same(foam, SMALL) for foam in wf.Trajectory(tmp_path / "run.h5")] == [True, True]
        monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
        before = contents(tmp_path)
        with pytest.raises(OSError, match=r"No space .*run\.h5"):
            wf.TrajectoryWriter(tmp_path / "run.h5", append=True)
        with (
            pytest.raises(OSError, match=r"No space .*new\.h5"),
            wf.TrajectoryWriter(tmp_path / "new.h5") as new,
        ):
            new.append(SMALL)
        assert contents(tmp_path) == before

    def test_without_the_call_the_free_space_is_asked(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9, 1000))
        with pytest.raises(OSError, match=r"No space .*new\.h5"):
            wf.TrajectoryWriter(tmp_path / "new.h5").append(SMALL)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 0, 10**9))
        with wf.TrajectoryWriter(tmp_path / "new.h5") as writer:
            writer.append(SMALL)

    def test_faults_of_the_library_name_the_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from warpedfoam.io import trajectory

        def broken(*_: object) -> None:
            raise RuntimeError("Driver truncate request failed\n(slist already enabled?)")

        monkeypatch.setattr(trajectory, "_put", broken)
        writer = wf.TrajectoryWriter(tmp_path / "run.h5")
        with pytest.raises(OSError, match=r"cannot write .*run\.h5: Driver truncate request failed \(slist"):
            writer.append(SMALL)
        with pytest.raises(ValueError, match="closed"):
            writer.append(SMALL)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.skipif(shutil.which("unshare") is None, reason="no small disk can be made")
    def test_a_disk_that_is_full_in_earnest(self, tmp_path: Path) -> None:
        """HDF5 2.0 ends the interpreter with a fault of segmentation if it is let."""
        code = """
        import sys
        import warpedfoam as wf
        from tests.io_foams import sphere_foam
        foam, told = sphere_foam(12), 0
        try:
            with wf.TrajectoryWriter(sys.argv[1]) as writer:
                for _ in range(1000):
                    writer.append(foam)
                    told += 1
        except OSError as fault:
            assert wf.Trajectory(sys.argv[1])[told - 1].energy == foam.energy
            print(told, len(wf.Trajectory(sys.argv[1])), fault.strerror, fault.filename == sys.argv[1])
        """
        script = tmp_path / "fill.py"
        script.write_text(textwrap.dedent(code))
        small = tmp_path / "small"
        small.mkdir()
        mount = f'mount -t tmpfs -o size=1m tmpfs "{small}" || exit 77; exec "$@"'
        done = subprocess.run(
            ["unshare", "-rm", "sh", "-c", mount, "sh", sys.executable, str(script), str(small / "run.h5")],
            capture_output=True,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"},
            timeout=120,
            check=False,
        )
        if done.returncode in (1, 77) and not done.stdout and "Traceback" not in done.stderr:
            pytest.skip(f"no small disk can be made: {done.stderr.strip()}")
        assert done.returncode == 0, done.stderr
        told, frames, *reason, named = done.stdout.split()
        assert int(told) == int(frames) > 10
        assert (" ".join(reason), named) == ("No space left on device", "True")


NAMES = ("Schäume & <泡>", "it's 100% 'so'", "a.b c", "#1?x=y", "-n")


@pytest.mark.parametrize("name", NAMES)
def test_names_as_people_give_them(tmp_path: Path, name: str) -> None:
    for ending, write in WRITERS.items():
        write(tmp_path / f"{name}{ending}", SMALL)
    assert _same(wf.load(tmp_path / f"{name}.npz"), SMALL)
    assert _same(wf.read_vtp(tmp_path / f"{name}.vtp"), SMALL)
    for ending in (".ply", ".obj"):
        again = wf.import_polygons(tmp_path / f"{name}{ending}", SMALL.cell)
        assert again.energy == pytest.approx(SMALL.energy, rel=1e-12)
    with wf.TrajectoryWriter(tmp_path / f"{name}.h5") as writer:
        writer.append(SMALL)
    assert _same(wf.Trajectory(tmp_path / f"{name}.h5")[0], SMALL)
    # files that name other files
    import pyvista

    blocks = pyvista.read(tmp_path / f"{name}.vtm")
    assert blocks["films"].n_cells == SMALL.network.n_films
    series = pyvista.get_reader(tmp_path / f"{name}.pvd").read()
    assert series[0].n_lines == SMALL.network.n_films
    assert not list(tmp_path.rglob("*.part"))


def test_a_reader_sees_one_foam_or_the_other(tmp_path: Path) -> None:
    """While another process writes over the file all the time."""
    code = """
    import sys
    import warpedfoam as wf
    from tests.test_failing_disks import LARGE, SMALL
    while True:
        for foam in (SMALL, LARGE):
            wf.save(sys.argv[1] + ".npz", foam)
            wf.write_vtp(sys.argv[1] + ".vtp", foam, curve_points=2)
        print("both", flush=True)
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), str(tmp_path / "f")],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"},
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "both\n"
        seen = set()
        for _ in range(100):
            for foam in (wf.load(tmp_path / "f.npz"), wf.read_vtp(tmp_path / "f.vtp")):
                seen.add(foam.n_bubbles)
                assert _same(foam, SMALL if foam.n_bubbles == 12 else LARGE)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert seen == {12, 30}


def test_numbers_that_are_none_are_not_written(tmp_path: Path) -> None:
    """No foam can hold them, so no file does."""
    for name, value in (("vertex_points", np.nan), ("film_offsets", np.inf), ("pressures", np.nan)):
        values = np.array(getattr(LARGE, name))
        values.flat[3] = value
        given = {key: getattr(LARGE, key) for key in ("vertex_points", "film_offsets", "pressures")}
        with pytest.raises(ValueError, match=f"{name} must be finite"):
            wf.Foam(LARGE.cell, LARGE.network, **{**given, name: values})
