"""Our files as other programs see them: by ending, every program that reads it, as named arrays.

What is asked of all of them is in `test_other_readers`. VTK is asked through its own readers, not through
pyvista; where pandas reads XML, base 64 is decoded here by the rules of VTK's format.
"""

from __future__ import annotations

import base64
import csv
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.csv
import pyarrow.parquet
import trimesh
from vtkmodules.util.numpy_support import vtk_to_numpy

Seen = dict[str, np.ndarray]
GRAPHML = {"g": "http://graphml.graphdrawing.org/xmlns"}
XML_TYPES = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}


def with_prefix(prefix: str, seen: Seen) -> Seen:
    return {f"{prefix}{name}": values for name, values in seen.items()}


# ---------------------------------------------------------------- the foam itself


def npz_numpy(path: Path) -> Seen:
    with np.load(path) as archive:
        return dict(archive)


def npz_by_hand(path: Path) -> Seen:
    """Python's zipfile, which compares checksums, and the array headers by NumPy's document NEP 1."""
    seen: Seen = {}
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        for member in archive.infolist():
            raw = archive.read(member)
            assert zlib.crc32(raw) == member.CRC
            magic, major, minor, length = struct.unpack("<6sBBH", raw[:10])
            assert (magic, major, minor) == (b"\x93NUMPY", 1, 0)
            assert (10 + length) % 64 == 0
            assert raw[9 + length : 10 + length] == b"\n"
            told = eval(raw[10 : 10 + length], {"__builtins__": {}})
            assert told.keys() == {"descr", "fortran_order", "shape"}
            assert not told["fortran_order"]
            # the format's letters, as struct knows them
            code, size = {"<i8": ("q", 8), "<f8": ("d", 8), "|u1": ("B", 1)}[told["descr"]]
            body = raw[10 + length :]
            values = struct.unpack(f"<{len(body) // size}{code}", body)
            kind = {"q": np.int64, "d": np.float64, "B": np.uint8}[code]
            seen[member.filename.removesuffix(".npy")] = np.array(values, dtype=kind).reshape(told["shape"])
    return seen


def h5_h5py(path: Path) -> Seen:
    import h5py

    with h5py.File(path) as file:
        seen = {name: values[()] for name, values in file.items() if isinstance(values, h5py.Dataset)}
        return {**seen, "version": np.array(file.attrs["version"]), "cell": np.array(str(file.attrs["cell"]))}


def h5_pytables(path: Path) -> Seen:
    import tables

    with tables.open_file(path) as file:
        seen = {node.name: node[:] for node in file.walk_nodes("/", "Array")}
        told = file.root._v_attrs
        return {**seen, "version": np.array(told["version"]), "cell": np.array(str(told["cell"]))}


# ---------------------------------------------------------------- VTK's formats


def _vtk_read(name: str, path: Path) -> Any:
    from vtkmodules import vtkIOGeometry, vtkIOPLY, vtkIOXML

    module = next(m for m in (vtkIOXML, vtkIOPLY, vtkIOGeometry) if hasattr(m, name))
    reader = getattr(module, name)()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def _vtk_arrays(data: Any) -> Seen:
    count = data.GetNumberOfArrays()
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(count)}


def _vtk_polydata(data: Any) -> Seen:
    """Points, lines, polygons and all arrays."""
    seen: Seen = {"points": vtk_to_numpy(data.GetPoints().GetData())}
    for name, cells in (("line", data.GetLines()), ("polygon", data.GetPolys())):
        seen[f"{name}_corners"] = vtk_to_numpy(cells.GetConnectivityArray())
        seen[f"{name}_sizes"] = np.diff(vtk_to_numpy(cells.GetOffsetsArray()))
    return {**seen, **_vtk_arrays(data.GetCellData()), **_vtk_arrays(data.GetPointData())}


def vtp_vtk(path: Path) -> Seen:
    return _vtk_polydata(_vtk_read("vtkXMLPolyDataReader", path))


def vtp_pandas(path: Path) -> Seen:
    def arrays(place: str) -> Seen:
        table = pd.read_xml(path, xpath=f".//{place}/DataArray", parser="etree")
        seen = {}
        for row in table.itertuples():
            raw = base64.b64decode(row.DataArray)
            assert int.from_bytes(raw[:8], "little") == len(raw) - 8
            seen[row.Name] = np.frombuffer(raw[8:], XML_TYPES[row.type])
        return seen

    seen: Seen = {"points": arrays("Points")["Points"].reshape(-1, 3)}
    for name, cells in (("line", "Lines"), ("polygon", "Polys")):
        told = arrays(cells)
        seen[f"{name}_corners"], seen[f"{name}_sizes"] = (
            told["connectivity"],
            np.diff(told["offsets"], prepend=0),
        )
    return {**seen, **arrays("CellData")}


def vtm_vtk(path: Path) -> Seen:
    blocks = _vtk_read("vtkXMLMultiBlockDataReader", path)
    seen: Seen = {}
    for k in range(blocks.GetNumberOfBlocks()):
        name = blocks.GetMetaData(k).Get(blocks.NAME())
        seen |= with_prefix(f"{name}.", _vtk_polydata(blocks.GetBlock(k)))
    return seen


def vtm_pandas(path: Path) -> Seen:
    table = pd.read_xml(path, xpath=".//DataSet", parser="etree")
    seen: Seen = {}
    for row in table.itertuples():
        seen |= with_prefix(f"{row.name}.", vtp_pandas(path.parent / row.file))
    return seen


def pvd_vtk(path: Path) -> Seen:
    """ParaView's reader of series is not in VTK's Python: pyvista's, which reads each frame by VTK."""
    import pyvista

    reader = pyvista.get_reader(path)
    seen: Seen = {"times": np.array(reader.time_values)}
    for k in range(len(reader.time_values)):
        reader.set_active_time_point(k)
        seen |= with_prefix(f"{k}.", _vtk_polydata(reader.read()[0]))
    return seen


def pvd_pandas(path: Path) -> Seen:
    table = pd.read_xml(path, xpath=".//DataSet", parser="etree")
    seen: Seen = {"times": table["timestep"].to_numpy()}
    for k, name in enumerate(table["file"]):
        seen |= with_prefix(f"{k}.", vtp_pandas(path.parent / name))
    return seen


# ---------------------------------------------------------------- meshes and polygons


def _polygons(rows: list[Any]) -> Seen:
    return {
        "polygon_corners": np.concatenate([np.ravel(row) for row in rows]).astype(np.int64),
        "polygon_sizes": np.array([len(row) for row in rows]),
    }


def ply_trimesh(path: Path) -> Seen:
    mesh = trimesh.load(path, process=False)
    raw = mesh.metadata["_ply_raw"]
    face, edge = raw["face"]["data"], raw["edge"]["data"]
    seen: Seen = {"points": np.asarray(mesh.vertices), **_polygons(list(face["vertex_indices"]))}
    seen |= {name: np.ravel(v) for name, v in face.items() if name != "vertex_indices"}
    return {**seen, **with_prefix("edge.", {name: np.ravel(v) for name, v in edge.items()})}


def ply_vtk(path: Path) -> Seen:
    seen = _vtk_polydata(_vtk_read("vtkPLYReader", path))
    return {**seen, **dict(zip(("red", "green", "blue"), seen["RGB"].T, strict=True))}


def ply_pandas(path: Path) -> Seen:
    """The three tables of an ASCII file; faces are lines of different lengths."""
    lines = path.read_text("ascii").splitlines()
    head = lines.index("end_header")
    names: dict[str, list[str]] = {}
    counts: list[int] = []
    for words in map(str.split, lines[:head]):
        if words[0] == "element":
            counts.append(int(words[2]))
            table = names.setdefault(words[1], [])
        elif words[0] == "property":
            table.append(words[-1])

    def table_of(name: str, skipped: int, rows: int) -> pd.DataFrame:
        table = pd.read_csv(
            path, sep=" ", header=None, names=names[name], skiprows=skipped, nrows=rows, dtype=str
        )
        return table.astype(float)

    points = table_of("vertex", head + 1, counts[0])
    edges = table_of("edge", head + 1 + counts[0] + counts[1], counts[2])
    faces = [row.split() for row in lines[head + 1 + counts[0] :][: counts[1]]]
    corners = [[int(w) for w in row[1 : 1 + int(row[0])]] for row in faces]
    tails = pd.DataFrame([row[1 + int(row[0]) :] for row in faces], columns=names["face"][1:]).astype(float)
    assert len(lines) == head + 1 + sum(counts)
    return {
        "points": points[["x", "y", "z"]].to_numpy(),
        **_polygons(corners),
        **{name: tails[name].to_numpy() for name in tails},
        **with_prefix("edge.", {name: edges[name].to_numpy() for name in edges}),
    }


def view_trimesh(path: Path) -> Seen:
    mesh = trimesh.load(path, process=False)
    raw = mesh.metadata["_ply_raw"]["vertex"]["data"]
    return {
        "points": np.asarray(mesh.vertices),
        "triangles": np.asarray(mesh.faces),
        "rgb": mesh.visual.vertex_colors[:, :3],
        "normals": np.asarray(mesh.vertex_normals),
        "quality": raw["quality"],
    }


def view_vtk(path: Path) -> Seen:
    seen = _vtk_polydata(_vtk_read("vtkPLYReader", path))
    return {
        "points": seen["points"],
        "triangles": seen["polygon_corners"].reshape(-1, 3),
        "rgb": seen["RGB"],
        "normals": seen["Normals"],
    }


def view_meshio(path: Path) -> Seen:
    mesh = meshio.read(path)
    data = mesh.point_data
    return {
        "points": mesh.points,
        "triangles": mesh.cells_dict["triangle"],
        # meshio takes PLY's unsigned characters for signed ones
        "rgb": np.stack([data[name] for name in ("red", "green", "blue")], axis=1).astype(np.uint8),
        "normals": np.stack([data[name] for name in ("nx", "ny", "nz")], axis=1),
        "quality": data["quality"],
    }


def mesh_trimesh(path: Path) -> Seen:
    mesh = trimesh.load(path, process=False)
    return {"points": np.asarray(mesh.vertices), "triangles": np.asarray(mesh.faces)}


def mesh_meshio(path: Path) -> Seen:
    mesh = meshio.read(path)
    return {"points": mesh.points, "triangles": mesh.cells_dict["triangle"]}


def mesh_vtk(path: Path) -> Seen:
    """VTK keeps the points of PLY files in single precision."""
    seen = _vtk_polydata(_vtk_read("vtkPLYReader", path))
    return {"points": seen["points"], "triangles": seen["polygon_corners"].reshape(-1, 3)}


def obj_vtk(path: Path) -> Seen:
    seen = _vtk_polydata(_vtk_read("vtkOBJReader", path))
    return {**seen, "groups": seen["GroupIds"]}


def obj_meshio(path: Path) -> Seen:
    mesh = meshio.read(path)
    rows = [row for cells in mesh.cells for row in cells.data]
    return {
        "points": mesh.points,
        **_polygons(rows),
        "groups": np.concatenate(mesh.cell_data["obj:group_ids"]),
    }


def glb_trimesh(path: Path) -> Seen:
    mesh = trimesh.load_scene(path).geometry["bubbles"]
    return {
        "points": np.asarray(mesh.vertices),
        "triangles": np.asarray(mesh.faces),
        "rgb": mesh.visual.vertex_colors[:, :3],
        "normals": np.asarray(mesh.vertex_normals),
        "bubble": mesh.vertex_attributes["_BUBBLE"].ravel(),
        "quality": mesh.vertex_attributes["_QUALITY"].ravel(),
    }


def glb_vtk(path: Path) -> Seen:
    block = _vtk_read("vtkGLTFReader", path)
    while hasattr(block, "GetBlock"):
        assert block.GetNumberOfBlocks() == 1
        block = block.GetBlock(0)
    seen = _vtk_polydata(block)
    return {
        "points": seen["points"],
        "triangles": seen["polygon_corners"].reshape(-1, 3),
        "rgb": np.round(255.0 * seen["COLOR_0"][:, :3]),
        "normals": seen["NORMAL"],
        "bubble": seen["_BUBBLE"],
        "quality": seen["_QUALITY"],
    }


def glb_by_hand(path: Path) -> Seen:
    """By the specification (Khronos, glTF 2.0, 3.6 and 4.4): trimesh has written what trimesh reads."""
    data = path.read_bytes()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON"
    told = json.loads(data[20 : 20 + size])
    more, kind = struct.unpack("<I4s", data[20 + size : 28 + size])
    assert (kind, 28 + size + more) == (b"BIN\0", length)
    body = data[28 + size :]

    def accessor(place: int) -> np.ndarray:
        one = told["accessors"][place]
        part = told["bufferViews"][one["bufferView"]]
        assert "byteStride" not in part
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[one["type"]]
        form = {5121: "u1", 5125: "<u4", 5126: "<f4"}[one["componentType"]]
        start = part.get("byteOffset", 0) + one.get("byteOffset", 0)
        flat = np.frombuffer(body, form, one["count"] * width, start)
        return flat if width == 1 else flat.reshape(-1, width)

    (mesh,) = told["meshes"]
    (part,) = mesh["primitives"]
    assert part.get("mode", 4) == 4  # triangles
    given = {name: accessor(place) for name, place in part["attributes"].items()}
    return {
        "points": given["POSITION"],
        "triangles": accessor(part["indices"]).reshape(-1, 3),
        "rgb": given["COLOR_0"][:, :3],
        "normals": given["NORMAL"],
        "bubble": given["_BUBBLE"],
        "quality": given["_QUALITY"],
    }


# ---------------------------------------------------------------- graphs and tables


def _sorted_edges(table: pd.DataFrame) -> Seen:
    """Edges in the order of the films; which end comes first tells nothing."""
    table = table.sort_values("film")
    ends = np.sort(table[["source", "target"]].astype(int).to_numpy(), axis=1)
    seen = {name: table[name].to_numpy() for name in table if name not in ("source", "target", "key", "id")}
    return with_prefix("edge.", {**seen, "ends": ends})


def _nodes(table: pd.DataFrame) -> Seen:
    return {name: table[name].to_numpy() for name in table}


def _networkx_seen(graph: nx.MultiGraph) -> Seen:
    assert graph.is_multigraph()
    nodes = pd.DataFrame([data for _, data in sorted(graph.nodes(data=True), key=lambda one: int(one[0]))])
    edges = [{"source": a, "target": b, **data} for a, b, data in graph.edges(data=True)]
    return {**_nodes(nodes), **_sorted_edges(pd.DataFrame(edges))}


def graphml_networkx(path: Path) -> Seen:
    return _networkx_seen(nx.read_graphml(path, force_multigraph=True))


def graphml_rustworkx(path: Path) -> Seen:
    import rustworkx

    (graph,) = rustworkx.read_graphml(str(path))
    nodes = pd.DataFrame(graph.nodes())
    assert nodes.pop("id").tolist() == [str(k) for k in range(len(nodes))]  # the file's name of the node
    edges = [{"source": a, "target": b, **data} for a, b, data in graph.weighted_edge_list()]
    return {**_nodes(nodes), **_sorted_edges(pd.DataFrame(edges))}


def graphml_pandas(path: Path) -> Seen:
    def rows(xpath: str) -> pd.DataFrame:
        return pd.read_xml(path, xpath=xpath, namespaces=GRAPHML, parser="etree")

    keys = rows(".//g:key")
    seen: dict[str, dict[str, Any]] = {"node": {}, "edge": {}}
    for key in keys.itertuples():
        name = key[keys.columns.get_loc("attr.name") + 1]
        values = rows(f".//g:{key[1 + keys.columns.get_loc('for')]}/g:data[@key='{key.id}']")["data"]
        seen[key[1 + keys.columns.get_loc("for")]][name] = values
    edges = pd.DataFrame(seen["edge"]).assign(**rows(".//g:edge")[["source", "target"]])
    return {**_nodes(pd.DataFrame(seen["node"])), **_sorted_edges(edges)}


def json_networkx(path: Path) -> Seen:
    return _networkx_seen(nx.node_link_graph(json.loads(path.read_text()), edges="edges"))


def json_pandas(path: Path) -> Seen:
    told = json.loads(path.read_text())
    nodes, edges = pd.DataFrame(told["nodes"]), pd.DataFrame(told["edges"])
    assert nodes.pop("id").tolist() == list(range(len(nodes)))
    return {**_nodes(nodes), **_sorted_edges(edges)}


def csv_pandas(path: Path) -> Seen:
    """As text first: older versions of pandas round numbers."""
    return _nodes(pd.read_csv(path, dtype=str).astype(float))


def csv_pyarrow(path: Path) -> Seen:
    table = pyarrow.csv.read_csv(path).to_pandas()
    return _nodes(table.astype({name: float for name in table if table[name].isna().all()}))


def csv_python(path: Path) -> Seen:
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def parquet_pyarrow(path: Path) -> Seen:
    table = pyarrow.parquet.read_table(path)
    assert {str(field.type) for field in table.schema} == {"int64", "double"}
    return _nodes(table.to_pandas())


def parquet_fastparquet(path: Path) -> Seen:
    import fastparquet

    with path.open("rb") as stream:
        return _nodes(fastparquet.ParquetFile(stream).to_pandas())


READERS: dict[str, dict[str, Callable[[Path], Seen]]] = {
    ".npz": {"NumPy": npz_numpy, "Python's zipfile": npz_by_hand},
    ".h5": {"h5py": h5_h5py, "PyTables": h5_pytables},
    ".vtp": {"VTK": vtp_vtk, "pandas": vtp_pandas},
    ".vtm": {"VTK": vtm_vtk, "pandas": vtm_pandas},
    ".pvd": {"pyvista": pvd_vtk, "pandas": pvd_pandas},
    ".ply": {"trimesh": ply_trimesh, "VTK": ply_vtk, "pandas": ply_pandas},
    "_view.ply": {"trimesh": view_trimesh, "VTK": view_vtk, "meshio": view_meshio},
    "mesh.ply": {"trimesh": mesh_trimesh, "VTK": mesh_vtk, "meshio": mesh_meshio},
    ".obj": {"VTK": obj_vtk, "meshio": obj_meshio},
    ".glb": {"trimesh": glb_trimesh, "VTK": glb_vtk, "struct": glb_by_hand},
    ".graphml": {"networkx": graphml_networkx, "rustworkx": graphml_rustworkx, "pandas": graphml_pandas},
    ".json": {"networkx": json_networkx, "pandas": json_pandas},
    ".csv": {"pandas": csv_pandas, "PyArrow": csv_pyarrow, "csv": csv_python},
    ".parquet": {"PyArrow": parquet_pyarrow, "fastparquet": parquet_fastparquet},
}
