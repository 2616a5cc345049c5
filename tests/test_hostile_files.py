"""Files and names as they come: line ends, byte order marks, foreign letters, lies in headers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .io_foams import sphere_foam

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
