"""Atomic writing, run records, tables and saved foams."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import os
import stat
import zipfile
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from warpedfoam import FileFormatError, Foam, HeleShawCell, Sphere
from warpedfoam.io import (
    atomic_binary,
    atomic_text,
    load,
    save,
    versions,
    write_bubbles_csv,
    write_films_csv,
    write_record,
)

from .io_foams import lone_bubble, sphere_foam, torus_foam, with_pressures

ARRAYS = ("vertex_points", "film_offsets", "target_volumes", "bubble_ids", "pressures")
NETWORK = ("next", "origin", "bubble", "bubble_euler")


class TestAtomic:
    def test_replaces_the_file_at_the_end_only(self, tmp_path: Path) -> None:
        path = tmp_path / "a.txt"
        path.write_text("old")
        with atomic_text(path) as stream:
            stream.write("γ\n")
            stream.flush()
            assert path.read_text() == "old"
        assert path.read_bytes() == "γ\n".encode()
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt, SystemExit])
    def test_a_failure_leaves_the_old_file_and_no_litter(
        self, tmp_path: Path, fault: type[BaseException]
    ) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(b"old")

        def write() -> None:
            with atomic_binary(path) as stream:
                stream.write(b"half")
                raise fault

        with pytest.raises(fault):
            write()
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]

    def test_permissions_are_those_of_any_new_file_or_of_the_old_one(self, tmp_path: Path) -> None:
        plain, path = tmp_path / "plain", tmp_path / "a.bin"
        plain.write_bytes(b"")
        for mode in (stat.S_IMODE(plain.stat().st_mode), 0o640):
            with atomic_binary(path) as stream:
                stream.write(b"x")
            assert stat.S_IMODE(path.stat().st_mode) == mode
            path.chmod(0o640)

    def test_a_link_stays_a_link(self, tmp_path: Path) -> None:
        (tmp_path / "deep").mkdir()
        target, link = tmp_path / "deep" / "real", tmp_path / "link"
        target.write_text("old")
        link.symlink_to(target)
        with atomic_text(link) as stream:
            stream.write("new")
        assert link.is_symlink()
        assert target.read_text() == "new"

    def test_refuses_what_it_cannot_write(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        for path, fault, words in (
            (tmp_path / "no" / "a", FileNotFoundError, "make it first"),
            (tmp_path, IsADirectoryError, "it is a folder"),
            (tmp_path / "file" / "a", ValueError, "not a folder"),
            ("", ValueError, "must name a file"),
            (3, TypeError, "string or a pathlib.Path"),
        ):
            with pytest.raises(fault, match=words), atomic_text(path):  # type: ignore[arg-type]
                pass

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
    def test_refuses_special_files(self, tmp_path: Path) -> None:
        # a pipe of the test's own: never name a real device here, a fault would replace it
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        with pytest.raises(ValueError, match="not a regular file"), atomic_text(pipe):
            pass
        assert pipe.is_fifo()


class TestRecord:
    def test_numpy_values_become_plain_ones(self, tmp_path: Path) -> None:
        record = {
            "z": np.float64(0.1),
            "a": np.arange(3),
            "m": {"flag": np.bool_(True), "none": None, "n": (np.int32(2), 2**80)},
            "ü": Path("γ.ply"),
        }
        text = write_record(tmp_path / "r.json", record).read_text(encoding="utf-8")
        assert json.loads(text) == {
            "z": 0.1,
            "a": [0, 1, 2],
            "m": {"flag": True, "none": None, "n": [2, 2**80]},
            "ü": "γ.ply",
        }
        assert "γ" in text
        assert text.index('"a"') < text.index('"m"') < text.index('"z"')

    @pytest.mark.parametrize(
        ("record", "fault", "place"),
        [
            ({"a": [1.0, np.nan]}, ValueError, r"record\['a'\]\[1\]"),
            ({"a": np.array([np.inf])}, ValueError, r"record\['a'\]\[0\]"),
            ({"a": {3: 1}}, TypeError, "keys"),
            ({"a": {1, 2}}, TypeError, "set"),
            ([1], TypeError, "mapping"),
        ],
    )
    def test_names_what_json_cannot_hold(
        self, tmp_path: Path, record: dict[str, object], fault: type[Exception], place: str
    ) -> None:
        with pytest.raises(fault, match=place):
            write_record(tmp_path / "r.json", record)
        assert not list(tmp_path.iterdir())

    def test_versions(self) -> None:
        found = versions()
        assert found["numpy"] == np.__version__
        assert found["matplotlib"] == metadata.version("matplotlib")
        present = importlib.util.find_spec("pypardiso") is not None
        assert found.get("pypardiso") == (metadata.version("pypardiso") if present else None)

    def test_optional_packages_are_listed_if_installed_only(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def version(name: str) -> str:
            if name in absent:
                raise metadata.PackageNotFoundError(name)
            return "1.0"

        monkeypatch.setattr(metadata, "version", version)
        absent = {"pypardiso", "matplotlib"}
        assert "pypardiso" not in versions()
        assert versions()["matplotlib"] == "not installed"
        absent = set()
        assert versions()["pypardiso"] == "1.0"


def _table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {name: [row[name] for row in rows] for name in rows[0]}


class TestTables:
    def test_bubbles(self, tmp_path: Path) -> None:
        foam = with_pressures(sphere_foam(30))
        table = _table(write_bubbles_csv(tmp_path / "b.csv", foam))
        scalars = ["sides", "charge", "area", "volume", "pressure", "energy_share", "gaussian_curvature"]
        assert list(table) == ["id", "x", "y", "z", *scalars]
        assert [int(i) for i in table["id"]] == foam.bubble_ids.tolist()
        for name, values in (
            ("y", foam.bubble_centres[:, 1]),
            ("area", foam.bubble_areas),
            ("volume", foam.bubble_volumes),
            ("pressure", foam.pressures),
        ):
            assert [float(v) for v in table[name]] == values.tolist()  # every bit
        assert sum(int(q) for q in table["charge"]) == 12
        assert sum(map(float, table["energy_share"])) == pytest.approx(foam.energy, rel=1e-13)
        np.testing.assert_allclose([float(g) for g in table["gaussian_curvature"]], 0.25, rtol=1e-12)

    def test_energy_share_is_half_of_each_film(self, tmp_path: Path) -> None:
        foam = with_pressures(lone_bubble())
        shares = _table(write_bubbles_csv(tmp_path / "b.csv", foam))["energy_share"]
        np.testing.assert_allclose([float(s) for s in shares], foam.energy / 2, rtol=1e-13)

    def test_films(self, tmp_path: Path) -> None:
        foam = with_pressures(torus_foam())
        table = _table(write_films_csv(tmp_path / "f.csv", foam))
        place = {i: k for k, i in enumerate(foam.bubble_ids.tolist())}
        left, right = ([place[int(i)] for i in table[name]] for name in ("left", "right"))
        np.testing.assert_array_equal(left, foam.network.bubble[::2])
        np.testing.assert_array_equal(right, foam.network.bubble[1::2])
        assert foam.pressures is not None
        jump = foam.pressures[left] - foam.pressures[right]
        assert [float(v) for v in table["pressure_jump"]] == jump.tolist()
        middle = np.array([[float(v) for v in table[axis]] for axis in "xyz"]).T
        np.testing.assert_allclose(middle, foam.film_curves(3)[:, 1], atol=1e-13)
        tail, head = ([int(v) for v in table[name]] for name in ("tail", "head"))
        chord = np.linalg.norm(foam.vertex_points[head] - foam.vertex_points[tail], axis=1)
        assert (np.array([float(v) for v in table["length"]]) >= chord).all()
        assert foam.tension * sum(map(float, table["area"])) == pytest.approx(foam.energy, rel=1e-13)

    def test_no_pressures_are_blank_not_zero(self, tmp_path: Path) -> None:
        foam = sphere_foam(12)
        assert set(_table(write_bubbles_csv(tmp_path / "b.csv", foam))["pressure"]) == {""}
        assert set(_table(write_films_csv(tmp_path / "f.csv", foam))["pressure_jump"]) == {""}

    def test_refuses_what_is_no_foam(self, tmp_path: Path) -> None:
        for write in (write_bubbles_csv, write_films_csv, save):
            with pytest.raises(TypeError, match="must be a Foam"):
                write(tmp_path / "x", None)  # type: ignore[arg-type]


def _same(a: Foam, b: Foam) -> bool:
    def bits(foam: Foam) -> list[object]:
        found = [getattr(foam, name) for name in ARRAYS] + [getattr(foam.network, name) for name in NETWORK]
        return [None if v is None else (v.dtype, v.shape, v.tobytes()) for v in found]

    return (
        bits(a) == bits(b)
        and a.cell == b.cell
        and (a.tension, a.seed, a.order) == (b.tension, b.seed, b.order)
    )


@dataclass(frozen=True)
class Ball(Sphere):
    """A surface of the user's own."""


def _rewritten(path: Path, header: dict[str, object] | None = None, **arrays: np.ndarray | None) -> Path:
    """The saved foam with parts of its header and arrays replaced (or dropped, if None)."""
    with np.load(path) as archive:
        found = dict(archive)
    told = json.loads(found["header"].tobytes()) | (header or {})
    found["header"] = np.frombuffer(json.dumps(told).encode(), dtype=np.uint8)
    found |= arrays
    out = path.with_name("changed.npz")
    with out.open("wb") as stream:
        np.savez(stream, **{k: v for k, v in found.items() if v is not None})
    return out


class TestState:
    @pytest.mark.parametrize(
        "foam",
        [with_pressures(sphere_foam(30)), torus_foam(), lone_bubble(), sphere_foam(12).with_order(2)],
        ids=["sphere", "torus", "lone", "straight"],
    )
    def test_comes_back_to_the_last_bit(self, tmp_path: Path, foam: Foam) -> None:
        path = save(tmp_path / "foam.state", foam)  # the name is taken as it is
        assert path == tmp_path / "foam.state"
        again = load(path)
        assert _same(again, foam)
        assert again.energy == foam.energy
        assert not again.vertex_points.flags.writeable

    def test_surfaces_of_ones_own_are_named_to_load(self, tmp_path: Path) -> None:
        plain = sphere_foam(12)
        foam = Foam(HeleShawCell(Ball(2.0), 0.1), plain.network, plain.vertex_points)
        path = save(tmp_path / "foam.npz", foam)
        with pytest.raises(FileFormatError, match="'Ball', which is not known"):
            load(path)
        assert _same(load(path, surfaces=[Ball]), foam)

    def test_missing_file_and_folder(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError, match="no such file"):
            load(tmp_path / "none.npz")
        with pytest.raises(FileFormatError, match="not a file"):
            load(tmp_path)

    @pytest.mark.parametrize(
        ("header", "arrays", "words"),
        [
            ({"version": 2}, {}, "version 2"),
            ({"format": "other"}, {}, "not that of a foam"),
            ({"surface": {"class": "Plane", "fields": {}}}, {}, "'Plane'"),
            ({"surface": {"class": "Sphere", "fields": {"radius": -1.0}}}, {}, "greater than 0"),
            ({"surface": {"class": "Surface", "fields": {}}}, {}, "not known"),
            ({"gap": "wide"}, {}, "gap"),
            ({"pressures": True}, {}, "lacks pressures"),
            ({}, {"bubble": None}, "lacks bubble"),
            ({}, {"origin": np.full(180, 10**15)}, "below"),
            ({}, {"next": np.arange(180)}, "begins|fan"),
            ({}, {"vertex_points": np.full((60, 3), np.nan)}, "finite"),
            ({}, {"film_offsets": np.zeros(90)}, "shape"),
            ({}, {"bubble_ids": np.zeros(32)}, "type"),
        ],
    )
    def test_says_what_is_wrong(
        self, tmp_path: Path, header: dict[str, object], arrays: dict[str, np.ndarray], words: str
    ) -> None:
        path = save(tmp_path / "foam.npz", sphere_foam(32))
        with pytest.raises(FileFormatError, match=words):
            load(_rewritten(path, header, **arrays))

    def test_refuses_pickles_and_other_archives(self, tmp_path: Path) -> None:
        path = tmp_path / "x.npz"
        np.savez(path, header=np.array([{"a": 1}], dtype=object))
        with pytest.raises(FileFormatError, match="plain numbers"):
            load(path)
        np.savez(path, a=np.zeros(3))
        with pytest.raises(FileFormatError, match="no header"):
            load(path)
        np.savez_compressed(path, a=np.zeros(3))
        with pytest.raises(FileFormatError, match="compressed"):
            load(path)
        path.write_text("id,x\n1,2\n")
        with pytest.raises(FileFormatError, match=r"not an \.npz"):
            load(path)

    def test_a_huge_array_that_is_not_there_is_not_allocated(self, tmp_path: Path) -> None:
        buffer = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**14,)}
        )
        path = tmp_path / "x.npz"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("header.npy", buffer.getvalue())
        with pytest.raises(FileFormatError, match="bytes"):
            load(path)

    def test_damage_is_found_or_harmless(self, tmp_path: Path) -> None:
        foam = with_pressures(sphere_foam(8))
        whole = save(tmp_path / "foam.npz", foam).read_bytes()
        path, rng = tmp_path / "damaged.npz", np.random.default_rng(0)
        for length in (*rng.integers(0, len(whole), 150).tolist(), 0, 1, len(whole) - 1):
            path.write_bytes(whole[:length])
            with pytest.raises(FileFormatError):
                load(path)
        found = 0
        for place in rng.integers(0, len(whole), 600).tolist():
            damaged = bytearray(whole)
            damaged[place] ^= 1 << int(rng.integers(8))
            path.write_bytes(damaged)
            try:
                assert _same(load(path), foam)  # a time stamp or another byte of no account
            except FileFormatError:
                found += 1
        assert found > 300
