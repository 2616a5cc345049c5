"""Every written format, opened by two other programs each: counts, coordinates and numbers."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import meshio
import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import pyvista
import trimesh
from pyarrow import csv

import warpedfoam as wf
from warpedfoam.io.patches import bubble_patches, film_points

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures
from .test_io_files import _same


def flat_foam() -> wf.Foam:
    return wf.voronoi_foam(wf.HeleShawCell(wf.FlatTorus(4.0, 3.0), 0.1), 20, seed=1)


FOAMS = {
    "sphere": lambda: with_pressures(sphere_foam(30)),
    "torus": torus_foam,
    "lone": lone_bubble,
    "open": bubble_on_torus,
    "flat": flat_foam,
}


@pytest.fixture(scope="module", params=list(FOAMS))
def foam(request: pytest.FixtureRequest) -> wf.Foam:
    return FOAMS[request.param]()


class TestVtp:
    def test_comes_back_to_the_last_bit(self, tmp_path: Path, foam: wf.Foam) -> None:
        for fill in ("polygons", "triangles"):
            again = wf.read_vtp(wf.write_vtp(tmp_path / "foam.vtp", foam, fill=fill))
            assert _same(again, foam)
            assert again.energy == foam.energy

    def test_vtk_and_pyvista_see_the_foam(self, tmp_path: Path, foam: wf.Foam) -> None:
        path = wf.write_vtp(tmp_path / "foam.vtp", foam, curve_points=5)
        seen = pyvista.read(path)
        network = foam.network
        disks = foam.network.bubble_euler == 1
        assert (seen.n_lines, seen.n_faces) == (network.n_films, int(disks.sum()))
        along = film_points(foam, 5)
        np.testing.assert_array_equal(seen.points[: len(along.points)], along.points)
        lines = seen.lines.reshape(network.n_films, 6)
        np.testing.assert_array_equal(lines[:, 1:], along.chains)
        bubbles = seen.cell_data["kind"] == 1
        for name, values in (
            ("bubble", foam.bubble_ids),
            ("area", foam.bubble_areas),
            ("volume", foam.bubble_volumes),
            ("charge", network.charges),
            ("sides", network.sides),
            ("gaussian_curvature", foam.bubble_curvatures / foam.bubble_areas),
        ):
            np.testing.assert_array_equal(seen.cell_data[name][bubbles], values[disks])
        for name, values in (("length", foam.film_lengths), ("film_area", foam.film_areas)):
            np.testing.assert_array_equal(seen.cell_data[name][~bubbles], values)
        np.testing.assert_array_equal(seen.cell_data["left"][~bubbles], foam.bubble_ids[network.left])
        assert ("pressure" in seen.cell_data) == (foam.pressures is not None)
        # VTK itself, without pyvista's reading
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(path))
        reader.Update()
        assert reader.GetOutput().GetNumberOfCells() == network.n_films + int(disks.sum())

    def test_pandas_reads_the_same_numbers(self, tmp_path: Path, foam: wf.Foam) -> None:
        """Without VTK: the file's XML as a table, the arrays decoded by the format's rules."""
        path = wf.write_vtp(tmp_path / "foam.vtp", foam, curve_points=5)
        table = pd.read_xml(path, xpath=".//CellData/DataArray", parser="etree").set_index("Name")
        disks = foam.network.bubble_euler == 1
        count = foam.network.n_films + int(disks.sum())
        numpy_types = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}
        arrays = {}
        for name, row in table.iterrows():
            raw = base64.b64decode(row["DataArray"])
            assert int.from_bytes(raw[:8], "little") == len(raw) - 8
            arrays[name] = np.frombuffer(raw[8:], numpy_types[row["type"]])
        kind = arrays["kind"]
        assert len(kind) == count
        np.testing.assert_array_equal(arrays["area"][kind == 1], foam.bubble_areas[disks])
        np.testing.assert_array_equal(arrays["charge"][kind == 1], foam.network.charges[disks])
        np.testing.assert_array_equal(arrays["length"][kind == 0], foam.film_lengths)

    def test_triangles_have_the_bubbles_areas(self, tmp_path: Path) -> None:
        foam = sphere_foam(30)
        seen = pyvista.read(wf.write_vtp(tmp_path / "foam.vtp", foam, fill="triangles", parts="bubbles"))
        sizes = seen.compute_cell_sizes()["Area"]
        areas = np.bincount(seen.cell_data["bubble"], sizes)
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=0.02)

    def test_films_across_a_seam_are_short(self, tmp_path: Path) -> None:
        foam = flat_foam()
        seen = pyvista.read(wf.write_vtp(tmp_path / "foam.vtp", foam, parts="films", curve_points=17))
        drawn = seen.compute_cell_sizes()["Length"]
        np.testing.assert_allclose(drawn, foam.film_lengths, rtol=2e-3)
        bubbles = pyvista.read(wf.write_vtp(tmp_path / "foam.vtp", foam, parts="bubbles", curve_points=17))
        areas = [_area(bubbles.points[corners]) for corners in bubbles.irregular_faces]
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=2e-3)

    def test_series_and_blocks(self, tmp_path: Path) -> None:
        foams = [sphere_foam(12), sphere_foam(20)]
        reader = pyvista.get_reader(wf.write_pvd(tmp_path / "run.pvd", iter(foams), [0.5, 2.0]))
        assert reader.time_values == [0.5, 2.0]
        for k, one in enumerate(foams):
            reader.set_active_time_point(k)
            assert reader.read()[0].n_lines == one.network.n_films
        table = pd.read_xml(tmp_path / "run.pvd", xpath=".//DataSet", parser="etree")
        assert table["timestep"].tolist() == [0.5, 2.0]
        assert [wf.read_vtp(tmp_path / name).n_bubbles for name in table["file"]] == [12, 20]
        blocks = pyvista.read(wf.write_vtm(tmp_path / "foam.vtm", foams[0]))
        parts = pd.read_xml(tmp_path / "foam.vtm", xpath=".//DataSet", parser="etree")
        assert parts["name"].tolist() == ["bubbles", "films"]
        assert all((tmp_path / name).exists() for name in parts["file"])
        assert blocks.keys() == ["bubbles", "films"]
        assert blocks["films"].n_cells == foams[0].network.n_films
        assert set(blocks["bubbles"].cell_data["bubble"].tolist()) == set(range(12))
        assert _same(wf.read_vtp(tmp_path / "foam" / "films.vtp"), foams[0])

    def test_series_refuse_times_that_do_not_fit(self, tmp_path: Path) -> None:
        one = sphere_foam(12)
        for foams, times in (([one], [0.0, 1.0]), ([one, one], [0.0]), ([one, one], [1.0, 1.0]), ([], None)):
            with pytest.raises(ValueError, match=r"times|foams"):
                wf.write_pvd(tmp_path / "run.pvd", foams, times)
        assert not (tmp_path / "run.pvd").exists()

    def test_refuses_other_vtp_files(self, tmp_path: Path) -> None:
        pyvista.Sphere().save(tmp_path / "ball.vtp")
        with pytest.raises(wf.FileFormatError, match=r"no VTP file|no foam"):
            wf.read_vtp(tmp_path / "ball.vtp")
        path = wf.write_vtp(tmp_path / "foam.vtp", sphere_foam(12))
        path.write_text(path.read_text().replace('<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "c">]>'))
        with pytest.raises(wf.FileFormatError, match="entities"):
            wf.read_vtp(path)


def _area(corners: np.ndarray) -> float:
    """Of a flat polygon in the plane of x and y."""
    x, y, _ = corners.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_glb(tmp_path: Path) -> None:
    foam = with_pressures(sphere_foam(30))
    path = wf.write_glb(tmp_path / "foam.glb", foam, color_by="pressure", curve_points=5)
    patches = bubble_patches(foam, curve_points=5, rim_width=0.02)
    mesh = trimesh.load_scene(path).geometry["bubbles"]
    np.testing.assert_array_equal(mesh.faces, patches.triangles)
    np.testing.assert_allclose(mesh.vertices, patches.points, atol=1e-6)
    np.testing.assert_array_equal(
        np.round(mesh.vertex_attributes["_BUBBLE"].ravel()), foam.bubble_ids[patches.point_bubble]
    )
    blocks = pyvista.read(path).combine()
    assert blocks.n_cells == len(patches.triangles)
    np.testing.assert_allclose(np.sort(blocks.points[:, 2]), np.sort(patches.points[:, 2]), atol=1e-6)


def test_obj(tmp_path: Path, foam: wf.Foam) -> None:
    path = wf.write_obj(tmp_path / "foam.obj", foam, curve_points=5)
    disks = int((foam.network.bubble_euler == 1).sum())
    from vtkmodules.vtkIOGeometry import vtkOBJReader

    reader = vtkOBJReader()
    reader.SetFileName(str(path))
    reader.Update()
    seen = reader.GetOutput()
    assert (seen.GetNumberOfLines(), seen.GetNumberOfPolys()) == (foam.network.n_films, disks)
    other = meshio.read(path)
    along = film_points(foam, 5)
    np.testing.assert_allclose(other.points[: len(along.points)], along.points, rtol=1e-15)
    assert sum(len(c.data) for c in other.cells if c.type not in ("line", "vertex")) == disks


@pytest.mark.parametrize("graph", ["bubbles", "films"])
def test_graphs(tmp_path: Path, foam: wf.Foam, graph: str) -> None:
    network = foam.network
    n_nodes = network.n_bubbles if graph == "bubbles" else network.n_vertices
    read = nx.read_graphml(
        wf.write_graphml(tmp_path / "net.graphml", foam, graph=graph), force_multigraph=True
    )
    told = json.loads(wf.write_graph_json(tmp_path / "net.json", foam, graph=graph).read_text())
    back = nx.node_link_graph(told, edges="edges")
    table = pd.DataFrame(told["edges"]).sort_values("film")
    np.testing.assert_array_equal(table["length"], foam.film_lengths)
    for one in (read, back):
        assert one.is_multigraph()
        assert (one.number_of_nodes(), one.number_of_edges()) == (n_nodes, network.n_films)
        lengths = {data["film"]: data["length"] for _, _, data in one.edges(data=True)}
        assert [lengths[f] for f in range(network.n_films)] == foam.film_lengths.tolist()
        places = foam.bubble_centres if graph == "bubbles" else foam.vertex_points
        x = {int(node): data["x"] for node, data in one.nodes(data=True)}
        assert [x[k] for k in range(n_nodes)] == places[:, 0].tolist()
    # pandas sees the same in the GraphML's XML
    space = {"g": "http://graphml.graphdrawing.org/xmlns"}
    keys = pd.read_xml(tmp_path / "net.graphml", xpath=".//g:key", namespaces=space, parser="etree")
    key = keys.set_index("attr.name").loc["length", "id"]
    ends = pd.read_xml(tmp_path / "net.graphml", xpath=".//g:edge", namespaces=space, parser="etree")
    drawn = pd.read_xml(
        tmp_path / "net.graphml", xpath=f".//g:edge/g:data[@key='{key}']", namespaces=space, parser="etree"
    )
    assert len(ends) == network.n_films
    assert sorted(drawn["data"]) == sorted(foam.film_lengths)


def test_parquet(tmp_path: Path, foam: wf.Foam) -> None:
    for write, text in (
        (wf.write_bubbles_parquet, wf.write_bubbles_csv),
        (wf.write_films_parquet, wf.write_films_csv),
    ):
        path = write(tmp_path / "t.parquet", foam)
        table, frame = pq.read_table(path), pd.read_parquet(path)
        plain = pd.read_csv(text(tmp_path / "t.csv", foam))
        arrow = csv.read_csv(tmp_path / "t.csv")
        assert arrow.num_rows == len(plain)
        assert table.column_names == list(frame.columns) == list(plain.columns)
        for name in frame.columns:
            np.testing.assert_allclose(frame[name].to_numpy(), plain[name].to_numpy(), rtol=1e-15)
            assert str(table.schema.field(name).type) in ("int64", "double")
            if plain[name].notna().all():
                np.testing.assert_array_equal(arrow[name].to_numpy(), frame[name].to_numpy())


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for name in ("h5py", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=r"h5py.*warpedfoam\[formats\]"):
        wf.Trajectory(tmp_path / "run.h5")
    with pytest.raises(ImportError, match=r"pyarrow.*warpedfoam\[formats\]"):
        wf.write_bubbles_parquet(tmp_path / "b.parquet", sphere_foam(12))


def test_names_must_end_rightly(tmp_path: Path) -> None:
    foam = sphere_foam(12)
    for write in (
        wf.write_vtp, wf.write_vtm, wf.write_glb, wf.write_obj, wf.write_graphml, wf.write_graph_json,
        wf.write_bubbles_parquet, wf.write_fe,
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must end in"):
            write(tmp_path / "foam.xyz", foam)
        assert not list(tmp_path.iterdir())


def test_importing_stays_light() -> None:
    import subprocess
    import sys

    code = "import sys, warpedfoam; print({'h5py', 'pyarrow', 'pandas', 'vtk', 'meshio'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
