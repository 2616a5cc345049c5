"""Files and names as they come: line ends, byte order marks, foreign letters, lies in headers."""

from __future__ import annotations

import io
import json
import os
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.io.hdf5_superblock import seal
from warpedfoam.studies.checkpoint import Checkpoint
from warpedfoam.studies.journal import JOURNAL, Journal
from warpedfoam.surfaces import read_mesh

from .io_foams import sphere_foam
from .test_io_files import _rewritten

FOAM = sphere_foam(12, even=True)
HEAD = (
    "ply\nformat {form} 1.0\nelement vertex {points}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {faces}\nproperty list {kind} int vertex_indices\nend_header\n"
)


def written(folder: Path, ending: str) -> bytes:
    path = folder / f"foam{ending}"
    (wf.write_ply if ending == ".ply" else wf.write_obj)(path, FOAM)
    return path.read_bytes()


CHANGES = {
    "windows": lambda data: data.replace(b"\n", b"\r\n"),
    "old mac": lambda data: data.replace(b"\n", b"\r"),
    "byte order mark": lambda data: b"\xef\xbb\xbf" + data,
    "latin 1": lambda data: data.replace(b"written by", b"\xe9crit par"),
    "end in a comment": lambda data: data.replace(b"written by", b"end_header by"),
}


@pytest.mark.parametrize("ending", [".ply", ".obj"])
@pytest.mark.parametrize("change", CHANGES)
def test_other_editors(tmp_path: Path, change: str, ending: str) -> None:
    path = tmp_path / f"泡 é{ending}"
    path.write_bytes(CHANGES[change](written(tmp_path, ending)))
    again = wf.import_polygons(path, FOAM.cell)
    assert again.energy == pytest.approx(FOAM.energy, rel=1e-12)


def test_a_mark_does_not_swallow_the_first_point(tmp_path: Path) -> None:
    lines = written(tmp_path, ".obj").decode().splitlines()
    bare = "\n".join(line for line in lines if line.startswith(("v ", "f ")))
    (tmp_path / "f.obj").write_bytes(b"\xef\xbb\xbf" + bare.encode())
    again = wf.import_polygons(tmp_path / "f.obj", FOAM.cell)
    assert again.energy == pytest.approx(FOAM.energy, rel=1e-12)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize(
    ("points", "faces", "kind", "words"),
    [
        (10**18, 1, "uchar", "ends"),
        (1, 10**30, "uchar", "ends"),
        (1, 3, "float", "no whole number"),
        (1, -1, "uchar", "elements"),
        (1, 2, "complex", "complex"),
    ],
)
def test_headers_that_lie(tmp_path: Path, form: str, points: int, faces: int, kind: str, words: str) -> None:
    head = HEAD.format(form=form, points=points, faces=faces, kind=kind)
    (tmp_path / "f.ply").write_bytes(head.encode() + b"1 2 3\n" + b"3 0 0 0\n" * 3)
    with pytest.raises(wf.FileFormatError, match=words):
        wf.import_polygons(tmp_path / "f.ply", FOAM.cell)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("v 1 2 3\nf 1 1\n", "2 corners"),
        ("v 1 2 3\nf\n", "0 corners"),
        ("v 1 2 3\nf 1 1 99999999999999999999999999\n", "names a point"),
        ("v 1e400 2 3\nf 1 1 1\n", "not finite"),
        ("v 1,5 2 3\n", "line 1"),
    ],
)
def test_polygons_that_lie(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "f.obj").write_text(text)
    with pytest.raises(wf.FileFormatError, match=words):
        wf.import_polygons(tmp_path / "f.obj", FOAM.cell)


def test_sixteen_bits_a_letter(tmp_path: Path) -> None:
    for ending in (".ply", ".obj"):
        (tmp_path / f"f{ending}").write_bytes(written(tmp_path, ending).decode().encode("utf-16"))
        with pytest.raises(wf.FileFormatError, match=r"no text|no PLY"):
            wf.import_polygons(tmp_path / f"f{ending}", FOAM.cell)
    vtp = wf.write_vtp(tmp_path / "f.vtp", FOAM)
    vtp.write_bytes(vtp.read_text().encode("utf-16"))
    with pytest.raises(wf.FileFormatError, match="no text"):
        wf.read_vtp(vtp)


def test_arguments_of_writers(tmp_path: Path) -> None:
    for time in (np.nan, "x", [1.0, 2.0]):
        with pytest.raises((ValueError, TypeError), match="time"):
            wf.write_vtp(tmp_path / "f.vtp", FOAM, time=time)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="iterable of Foams, got Foam"):
        wf.write_pvd(tmp_path / "f.pvd", FOAM)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="UTF-8 can hold"):
        wf.write_view(tmp_path / "f.html", FOAM, title="\udcff")
    assert not list(tmp_path.iterdir())


def test_folders_in_the_way(tmp_path: Path) -> None:
    """Nothing is written over a folder, and nothing is left behind."""
    writers = {
        ".vtp": wf.write_vtp, ".vtm": wf.write_vtm, ".glb": wf.write_glb, ".obj": wf.write_obj,
        ".ply": wf.write_ply, ".graphml": wf.write_graphml, ".json": wf.write_graph_json, ".npz": wf.save,
        ".parquet": wf.write_bubbles_parquet, ".csv": wf.write_bubbles_csv, ".fe": wf.write_fe,
        ".html": wf.write_view, ".h5": lambda path, foam: wf.TrajectoryWriter(path),
    }  # fmt: skip
    for ending, write in writers.items():
        (tmp_path / f"f{ending}").mkdir()
        with pytest.raises(IsADirectoryError, match="it is a folder"):
            write(tmp_path / f"f{ending}", FOAM)
        with pytest.raises(FileNotFoundError, match="make it first"):
            write(tmp_path / "none" / f"f{ending}", FOAM)
        with pytest.raises((TypeError, ValueError), match=r"path|file"):
            write(b"f" + ending.encode(), FOAM)
    (tmp_path / "series").write_text("a file")
    with pytest.raises(ValueError, match="must be a folder"):
        wf.write_pvd(tmp_path / "series.pvd", [FOAM])
    assert all(path.is_dir() or path.name == "series" for path in tmp_path.iterdir())
    assert len(list(tmp_path.iterdir())) == len(writers) + 1


# ---------------------------------------------------------------- made to hurt, with checksums that are right


def test_members_that_share_their_bytes_are_not_read(tmp_path: Path) -> None:
    """A zip file may name the same megabytes a thousand times."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        with archive.open("a0.npy", "w") as stream:
            np.lib.format.write_array(stream, np.zeros(1000))
        one = archive.filelist[0]
        for k in range(1, 10):
            again = zipfile.ZipInfo(f"a{k}.npy")
            for name in ("CRC", "file_size", "compress_size", "header_offset"):
                setattr(again, name, getattr(one, name))
            archive.filelist.append(again)
    (tmp_path / "f.npz").write_bytes(buffer.getvalue())
    with pytest.raises(wf.FileFormatError, match="compressed or damaged"):
        wf.load(tmp_path / "f.npz")


def test_a_member_twice(tmp_path: Path) -> None:
    path = wf.save(tmp_path / "f.npz", FOAM)
    with np.load(path) as archive:
        values = archive["next"]
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
        warnings.simplefilter("ignore")
        with archive.open("next.npy", "w") as stream:
            np.lib.format.write_array(stream, values)
    with pytest.raises(wf.FileFormatError, match=r"'next\.npy' twice"):
        wf.load(path)


def test_what_a_version_does_not_name_is_refused(tmp_path: Path) -> None:
    """A newer program may have put it there for a reason."""
    path = wf.save(tmp_path / "f.npz", FOAM)
    for header, arrays, name in (
        ({"gravity": 9.8}, {}, "'gravity'"),
        ({}, {"charges": np.zeros(12)}, "'charges'"),
        ({}, {"pressures": np.zeros(12)}, "'pressures'"),
    ):
        with pytest.raises(wf.FileFormatError, match=f"not known here: {name}; use a newer"):
            wf.load(_rewritten(path, header, **arrays))


@pytest.mark.parametrize("depth", [10_000, 1_000_000])
def test_headers_nested_deeply(tmp_path: Path, depth: int) -> None:
    path = wf.save(tmp_path / "f.npz", FOAM)
    deep = np.frombuffer(b"[" * depth, dtype=np.uint8)
    with np.load(path) as archive:
        np.savez(tmp_path / "deep.npz", **{**archive, "header": deep})
    with pytest.raises(wf.FileFormatError, match="recursion"):
        wf.load(tmp_path / "deep.npz")


def test_faults_that_quote_the_file_stay_short(tmp_path: Path) -> None:
    path = _rewritten(wf.save(tmp_path / "f.npz", FOAM), {"surface": {"class": "x" * 10**6, "fields": {}}})
    head = HEAD.format(form="ascii", points=1, faces=1, kind="uchar").replace("element face", "9" * 10**6)
    (tmp_path / "f.ply").write_text(head)
    text = wf.write_vtp(tmp_path / "f.vtp", FOAM).read_text()
    (tmp_path / "f.vtp").write_text(text.replace('type="Int64"', f'type="{"9" * 10**6}"'))
    for read, file in (
        (wf.load, path),
        (wf.read_vtp, tmp_path / "f.vtp"),
        (lambda source: wf.import_polygons(source, FOAM.cell), tmp_path / "f.ply"),
    ):
        with pytest.raises(wf.FileFormatError) as caught:
            read(file)
        assert len(str(caught.value)) < 500


def _index_longer_than_the_file(file: h5py.File) -> None:
    file["index"].resize(10**9, axis=0)


def _data_longer_than_the_file(file: h5py.File) -> None:
    file["bubble_ids"].resize(10**12, axis=0)
    file["index"][0, 4] = 10**12


def _packed(file: h5py.File) -> None:
    del file["index"]
    file.create_dataset("index", (10**10, 11), np.int64, chunks=(4096, 11), compression="gzip")


def _linked(file: h5py.File) -> None:
    del file["next"]
    file["next"] = h5py.ExternalLink("/etc/hostname", "/next")


def _aliased(file: h5py.File) -> None:
    del file["next"]
    file["next"] = h5py.SoftLink("/origin")


def _more(file: h5py.File) -> None:
    file["gravity"] = np.zeros(3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_index_longer_than_the_file, "longer than the file"),
        (_data_longer_than_the_file, "end too early"),
        (_packed, "lacks index"),
        (_linked, "lacks next"),
        (_aliased, "lacks next"),
        (_more, "not known here: 'gravity'"),
    ],
)
def test_trajectories_that_promise_more_than_they_hold(
    tmp_path: Path, change: Callable[[h5py.File], None], words: str
) -> None:
    path = tmp_path / "f.h5"
    with wf.TrajectoryWriter(path) as writer:
        writer.append(FOAM)
    with h5py.File(path, "r+") as file:
        change(file)
    seal(path)
    with pytest.raises(wf.FileFormatError, match=words):
        list(wf.Trajectory(path))


def test_points_that_crowd(tmp_path: Path) -> None:
    """Pairs of points to be welded are not counted one by one: there may be 10^10."""
    rng = np.random.default_rng(0)
    crowd = np.array([1.0, 0.0, 0.0]) + 1e-9 * rng.standard_normal((100_000, 3))
    same = np.tile([1.0, 0.0, 0.0], (100_000, 1))
    faces = [[k, k + 1, k + 2] for k in range(0, 99_000, 3)]
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.1)
    with pytest.raises(wf.TopologyError, match="points crowd"):
        wf.import_polygons((crowd, faces), cell)
    with pytest.raises(wf.TopologyError, match="0 different corners"):
        wf.import_polygons((same, faces), cell)


def test_points_as_far_away_as_numbers_go(tmp_path: Path) -> None:
    text = written(tmp_path, ".obj").decode()
    rimmed = wf.HeleShawCell(wf.Cylinder(1.0, 2.0), 0.1)
    first = next(line for line in text.splitlines() if line.startswith("v "))
    for far in ("1e300", "-1e308", "1e154"):
        (tmp_path / "far.obj").write_text(text.replace(first, f"v {far} {far} {far}"))
        with pytest.raises(ValueError, match="must lie on the cell's surface"):
            wf.import_polygons(tmp_path / "far.obj", FOAM.cell)
        with pytest.raises(ValueError, match="must lie on the cell's surface"):
            wf.import_polygons(tmp_path / "far.obj", rimmed)


# ---------------------------------------------------------------- meshes


def glb(indices: list[int]) -> bytes:
    """A GLB file of one triangle over three points."""
    body = np.eye(3, dtype="<f4").tobytes() + np.array(indices, dtype="<u4").tobytes()
    told = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 4 * len(indices)},
        ],
        "buffers": [{"byteLength": len(body)}],
    }
    head = json.dumps(told).encode()
    head += b" " * (-len(head) % 4)
    chunks = np.array([len(head)], dtype="<u4").tobytes() + b"JSON" + head
    chunks += np.array([len(body)], dtype="<u4").tobytes() + b"BIN\0" + body
    return b"glTF" + np.array([2, 12 + len(chunks)], dtype="<u4").tobytes() + chunks


def test_triangles_of_points_that_are_not_there(tmp_path: Path) -> None:
    (tmp_path / "f.glb").write_bytes(glb([0, 1, 2]))
    assert read_mesh(tmp_path / "f.glb").n_triangles == 1
    for wrong in (3, 10**6, 2**32 - 1):
        (tmp_path / "f.glb").write_bytes(glb([0, 1, wrong]))
        with pytest.raises(wf.MeshError, match="triangles must be at least 0 and below 3"):
            read_mesh(tmp_path / "f.glb")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("ending", [".obj", ".ply"])
def test_materials_are_not_opened(tmp_path: Path, ending: str) -> None:
    """A pipe that nobody writes to would hold the reader up for ever."""
    os.mkfifo(tmp_path / "pipe")
    ball = wf.Sphere(1.0).triangulate(50)
    if ending == ".obj":
        rows = [f"v {x} {y} {z}" for x, y, z in ball.nodes.tolist()]
        rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in ball.triangles.tolist()]
        text = "\n".join(["mtllib pipe", *rows])
    else:
        head = HEAD.format(form="ascii", points=ball.n_nodes, faces=ball.n_triangles, kind="uchar")
        head = head.replace("element vertex", "comment TextureFile pipe\nelement vertex")
        head = head.replace("property float z\n", "property float z\nproperty float s\nproperty float t\n")
        rows = [f"{x} {y} {z} 0 0" for x, y, z in ball.nodes.tolist()]
        text = head + "\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in ball.triangles.tolist())])
    (tmp_path / f"ball{ending}").write_text(text)
    assert read_mesh(tmp_path / f"ball{ending}").n_triangles == ball.n_triangles


# ---------------------------------------------------------------- what long runs keep


@pytest.mark.parametrize(
    "text",
    ["", "[]", "3", "null", "{}", "[" * 100_000, '{"version": 1}', "泡", "{'version': 1}"],
    ids=lambda text: text[:12] or "empty",
)
def test_checkpoints_that_are_none(tmp_path: Path, text: str) -> None:
    one = Checkpoint(tmp_path, "run", {"seed": 1})
    one.path.write_text(text, encoding="utf-8")
    with pytest.raises(wf.FileFormatError, match=r"it is damaged .*; remove it to begin anew"):
        one.read()


def test_a_digit_of_a_checkpoint(tmp_path: Path) -> None:
    one = Checkpoint(tmp_path, "run", {"seed": 1})
    one.write({"length": 12.375, "done": [1, 2]}, {"best": FOAM})
    found = Checkpoint(tmp_path, "run", {"seed": 1}).read()
    assert found is not None
    assert found[0] == {"length": 12.375, "done": [1, 2]}
    text = one.path.read_text()
    wrong = {
        "checksum": text.replace("12.375", "12.376"),
        "lacks": text.replace('"serial"', '"derial"'),
        "other folders": json.dumps(_without_sum(text, foams={"best": "../run-000001.npz"})),
        "no such state": json.dumps(_without_sum(text, state=[1])),
    }
    for words, changed in wrong.items():
        assert changed != text
        one.path.write_text(changed)
        with pytest.raises(wf.FileFormatError, match=words):
            Checkpoint(tmp_path, "run", {"seed": 1}).read()
    # before there were sums
    one.path.write_text(json.dumps(_without_sum(text)))
    assert Checkpoint(tmp_path, "run", {"seed": 1}).read() is not None


def _without_sum(text: str, **changes: Any) -> dict[str, Any]:
    told = {**json.loads(text), **changes}
    del told["sum"]
    return told


def test_a_digit_of_a_journal(tmp_path: Path) -> None:
    row = {
        "key": "a", "status": "converged", "reason": "", "values": {"energy": 12.375}, "environment": "e",
        "seconds": 1.0,
    }  # fmt: skip
    journal = Journal(tmp_path)
    journal._write(row)
    journal.close()
    text = (tmp_path / JOURNAL).read_text()
    again = Journal(tmp_path)
    assert again.rows == {"a": row}
    again.close()
    for changed in (
        text.replace("12.375", "12.376"),
        text.replace('"seconds"', '"segonds"'),
        "[" * 100_000 + "\n",
        "[1]\n",
        '"content"\n',
        "3\n",
    ):
        (tmp_path / JOURNAL).write_text(changed)
        with pytest.raises(wf.FileFormatError, match=r"line 1 is damaged .* computed again"):
            Journal(tmp_path)
    older = {name: value for name, value in json.loads(text).items() if name != "sum"}
    (tmp_path / JOURNAL).write_text(json.dumps(older) + "\n")
    again = Journal(tmp_path)
    assert again.rows == {"a": row}
    again.close()
