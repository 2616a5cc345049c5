"""Every format, opened by two programs at least that are not ours: counts, coordinates, all numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.cli.converting import WRITERS
from warpedfoam.io.colours import FILM_COLOUR, as_rgb, bubble_colours
from warpedfoam.io.patches import bubble_patches, film_points, loop_points
from warpedfoam.io.scalars import bubble_scalars, film_scalars
from warpedfoam.io.state import arrays_of

from .io_foams import bubble_on_torus, lone_bubble, resized, sphere_foam, torus_foam, with_pressures
from .other_readers import READERS, Seen, with_prefix

FOAMS: dict[str, Callable[[], wf.Foam]] = {
    "sphere": lambda: with_pressures(sphere_foam(30)),
    "torus": torus_foam,
    "lone": lone_bubble,
    "open": bubble_on_torus,
    "tiny": lambda: resized(with_pressures(sphere_foam(12)), 1e-9),
    "huge": lambda: resized(with_pressures(sphere_foam(12)), 1e9),
    "flat": lambda: wf.voronoi_foam(wf.HeleShawCell(wf.FlatTorus(4.0, 3.0), 0.1), 20, seed=1),
}
CURVE = 5


def polygons_of(foam: wf.Foam) -> tuple[Seen, np.ndarray]:
    """The disks' polygons and all points, and the bubble of each polygon."""
    points, corners, sizes, bubble = loop_points(foam, film_points(foam, CURVE))
    disk = foam.network.bubble_euler[bubble] == 1
    seen = {
        "points": points,
        "polygon_corners": corners[np.repeat(disk, sizes)],
        "polygon_sizes": sizes[disk],
    }
    return seen, bubble[disk]


def padded(values: np.ndarray, name: str, films: int, *, first: bool) -> np.ndarray:
    """With what stands where a number has no meaning before it, or after."""
    void = np.full(films, np.nan if values.dtype.kind == "f" else 0 if name == "charge" else -1)
    return np.concatenate([void, values] if first else [values, void])


def in_vtp(foam: wf.Foam) -> Seen:
    seen, bubble = polygons_of(foam)
    chains = film_points(foam, CURVE).chains
    films = len(chains)
    seen |= {"line_corners": chains.ravel(), "line_sizes": np.full(films, CURVE)}
    seen["kind"] = np.repeat([0, 1], [films, len(bubble)])
    for name, values in bubble_scalars(foam).items():
        seen[name] = padded(values[bubble], name, films, first=True)
    for name, values in film_scalars(foam).items():
        seen[name] = padded(values, name, len(bubble), first=False)
    return seen


def in_vtm(foam: wf.Foam) -> Seen:
    along = film_points(foam, CURVE)
    patches = bubble_patches(foam, curve_points=CURVE)
    points = np.concatenate([along.points, patches.points])
    bubbles = {"points": points, "polygon_corners": patches.triangles.ravel() + len(along.points)}
    bubbles |= {name: values[patches.triangle_bubble] for name, values in bubble_scalars(foam).items()}
    films = {"points": along.points, "line_corners": along.chains.ravel(), **film_scalars(foam)}
    return {**with_prefix("bubbles.", bubbles), **with_prefix("films.", films)}


def in_ply(foam: wf.Foam) -> Seen:
    seen, bubble = polygons_of(foam)
    rgb = bubble_colours(foam, "area").rgb
    seen |= {name: rgb[bubble, k] for k, name in enumerate(("red", "green", "blue"))}
    seen |= {name: values[bubble] for name, values in bubble_scalars(foam).items()}
    along = film_points(foam, CURVE).chains
    edges = {"vertex1": along[:, :-1].ravel(), "vertex2": along[:, 1:].ravel()}
    films = film_scalars(foam)
    for name in ("film", "left", "right", "length"):
        edges[name] = np.repeat(films[name], CURVE - 1)
    edges["area"] = np.repeat(films["film_area"], CURVE - 1)
    return {**seen, **with_prefix("edge.", edges)}


def in_triangles(foam: wf.Foam) -> Seen:
    patches = bubble_patches(foam, curve_points=CURVE, rim_width=0.02)
    colours = bubble_colours(foam, "area")
    rgb = colours.rgb[patches.point_bubble]
    rgb[patches.point_rim] = as_rgb(FILM_COLOUR)
    return {
        "points": patches.points,
        "triangles": patches.triangles,
        "rgb": rgb,
        "normals": foam.cell.surface.normals(patches.points),
        "quality": colours.values[patches.point_bubble],
    }


def in_glb(foam: wf.Foam) -> Seen:
    patches = bubble_patches(foam, curve_points=CURVE, rim_width=0.02)
    return {**in_triangles(foam), "bubble": foam.bubble_ids[patches.point_bubble]}


def in_obj(foam: wf.Foam) -> Seen:
    seen, bubble = polygons_of(foam)
    return {**seen, "groups": np.arange(len(bubble))}


def in_graph(foam: wf.Foam, graph: str) -> Seen:
    network = foam.network
    edges = {"film": np.arange(network.n_films), "length": foam.film_lengths}
    if graph == "bubbles":
        seen: Seen = {
            "bubble": foam.bubble_ids,
            "sides": network.sides,
            "charge": network.charges,
            "area": foam.bubble_areas,
            "volume": foam.bubble_volumes,
            **dict(zip("xyz", foam.bubble_centres.T, strict=True)),
        }
        if foam.pressures is not None:
            seen["pressure"] = foam.pressures
        edges["ends"] = np.sort(np.stack([network.left, network.right], axis=1), axis=1)
    else:
        seen = {"degree": network.vertex_degrees, **dict(zip("xyz", foam.vertex_points.T, strict=True))}
        edges["ends"] = np.sort(np.stack([network.tails, network.heads], axis=1), axis=1)
        edges |= {"left": network.left, "right": network.right}
    return {**seen, **with_prefix("edge.", edges)}


def in_table(foam: wf.Foam, table: str) -> Seen:
    network, none = foam.network, np.nan
    if table == "bubbles":
        scalars = bubble_scalars(foam)
        scalars["id"] = scalars.pop("bubble")
        shares = np.zeros(foam.n_bubbles)
        for film, energy in enumerate((foam.tension * foam.film_areas).tolist()):
            for bubble in (network.left[film], network.right[film]):
                shares[bubble] += energy / 2.0
        seen = {"pressure": np.full(foam.n_bubbles, none), **scalars, "energy_share": shares}
        return {**seen, **dict(zip("xyz", foam.bubble_centres.T, strict=True))}
    scalars = film_scalars(foam)
    scalars["area"] = scalars.pop("film_area")
    middles = foam.film_curves(3)[:, 1]
    seen = {"pressure_jump": np.full(network.n_films, none), **scalars}
    seen |= {"tail": network.tails, "head": network.heads}
    return {**seen, **dict(zip("xyz", middles.T, strict=True))}


def in_h5(foams: list[wf.Foam]) -> Seen:
    frames = [arrays_of(foam) for foam in foams]
    names = [name for name in frames[0] if not name.startswith("surface")]
    seen = {name: np.concatenate([frame[name].ravel() for frame in frames]) for name in names}
    return {**seen, "time": np.array([0.0, 0.5]), "version": np.array(1)}


def two(foam: wf.Foam) -> list[wf.Foam]:
    """Frames in one cell with different topology, where the foam is on a sphere; else the foam twice."""
    if not isinstance(foam.cell.surface, wf.Sphere) or foam.cell.surface.radius != 2.0:
        return [foam, foam]
    other = sphere_foam(12)
    n = other.n_bubbles
    return [foam, wf.Foam(foam.cell, other.network, other.vertex_points, pressures=np.arange(float(n)))]


def write_h5(path: Path, foam: wf.Foam) -> Path:
    with wf.TrajectoryWriter(path) as writer:
        for time, one in zip((0.0, 0.5), two(foam), strict=True):
            writer.append(one, time=time)
    return path


def write_mesh(path: Path, foam: wf.Foam) -> Path:
    from warpedfoam.io import write_mesh as write

    return write(path, foam.cell.surface.triangulate(300))


def mesh_of(foam: wf.Foam) -> Seen:
    mesh = foam.cell.surface.triangulate(300)
    return {"points": mesh.nodes, "triangles": mesh.triangles}


Case = tuple[str, Callable[[Path, wf.Foam], object], Callable[[wf.Foam], Seen]]
#: By name: the key of the readers, how the file is written, and what must be in it.
CASES: dict[str, Case] = {
    "foam.npz": (".npz", wf.save, arrays_of),
    "foam.h5": (".h5", write_h5, lambda foam: in_h5(two(foam))),
    "foam.vtp": (".vtp", lambda path, foam: wf.write_vtp(path, foam, curve_points=CURVE), in_vtp),
    "foam.vtm": (".vtm", lambda path, foam: wf.write_vtm(path, foam, curve_points=CURVE), in_vtm),
    "foam.pvd": (
        ".pvd",
        lambda path, foam: wf.write_pvd(path, iter(two(foam)), [0.5, 2.0], curve_points=CURVE),
        lambda foam: {
            "times": np.array([0.5, 2.0]),
            **with_prefix("0.", in_vtp(two(foam)[0])),
            **with_prefix("1.", in_vtp(two(foam)[1])),
        },
    ),
    "foam.ply": (
        ".ply", lambda path, foam: wf.write_ply(path, foam, color_by="area", curve_points=CURVE), in_ply,
    ),
    "foam_view.ply": (
        "_view.ply",
        lambda path, foam: wf.write_ply(path.parent / "foam.ply", foam, color_by="area", curve_points=CURVE),
        in_triangles,
    ),
    "mesh.ply": ("mesh.ply", write_mesh, mesh_of),
    "foam.obj": (".obj", lambda path, foam: wf.write_obj(path, foam, curve_points=CURVE), in_obj),
    "foam.glb": (
        ".glb", lambda path, foam: wf.write_glb(path, foam, color_by="area", curve_points=CURVE), in_glb,
    ),
    "bubbles.graphml": (".graphml", wf.write_graphml, lambda foam: in_graph(foam, "bubbles")),
    "films.graphml": (
        ".graphml",
        lambda path, foam: wf.write_graphml(path, foam, graph="films"),
        lambda foam: in_graph(foam, "films"),
    ),
    "bubbles.json": (".json", wf.write_graph_json, lambda foam: in_graph(foam, "bubbles")),
    "films.json": (
        ".json",
        lambda path, foam: wf.write_graph_json(path, foam, graph="films"),
        lambda foam: in_graph(foam, "films"),
    ),
    "bubbles.csv": (".csv", wf.write_bubbles_csv, lambda foam: in_table(foam, "bubbles")),
    "films.csv": (".csv", wf.write_films_csv, lambda foam: in_table(foam, "films")),
    "bubbles.parquet": (".parquet", wf.write_bubbles_parquet, lambda foam: in_table(foam, "bubbles")),
    "films.parquet": (".parquet", wf.write_films_parquet, lambda foam: in_table(foam, "films")),
}  # fmt: skip
#: What a program leaves out of a file, or keeps in single precision; every quantity has two readers still.
LEFT_OUT = {
    (".ply", "VTK"): (
        "area",
        "volume",
        "pressure",
        "gaussian_curvature",
        "sides",
        "charge",
        "bubble",
        "edge.",
    ),
    ("_view.ply", "VTK"): ("quality",),
}
SINGLE = {(".ply", "VTK"), ("mesh.ply", "VTK"), (".obj", "VTK")}
SINGLE_FILES = ("_view.ply", ".glb")
#: Sums taken in another order here, and curves evaluated one point at a time.
ROUNDED = ("energy_share", "x", "y", "z")


@pytest.fixture(scope="module", params=list(FOAMS))
def foam(request: pytest.FixtureRequest) -> wf.Foam:
    return FOAMS[request.param]()


@pytest.mark.parametrize("name", CASES)
def test_what_others_see(tmp_path: Path, foam: wf.Foam, name: str) -> None:
    key, write, told = CASES[name]
    write(tmp_path / name, foam)
    wanted = told(foam)
    assert len(wanted) > 1
    seen_by = dict.fromkeys(wanted, 0)
    for program, read in READERS[key].items():
        seen = read(tmp_path / name)
        out = LEFT_OUT.get((key, program), ())
        for quantity, values in wanted.items():
            if quantity.startswith(out or ("no such",)):
                assert quantity not in seen
                continue
            assert quantity in seen, f"{program} does not see {quantity} of {name}"
            found = np.asarray(seen[quantity])
            assert found.shape == values.shape, (program, quantity)
            places = quantity.rpartition(".")[2] in ("points", "normals", "quality", "bubble")
            if places and ((key, program) in SINGLE or key in SINGLE_FILES):
                scale = np.abs(values).max()
                np.testing.assert_allclose(found, values, rtol=0.0, atol=2e-7 * scale, err_msg=program)
            elif quantity in ROUNDED:
                np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-14 * np.abs(values).max())
            else:
                np.testing.assert_array_equal(found, values, err_msg=f"{program}: {quantity}")
            seen_by[quantity] += 1
    assert min(seen_by.values()) >= 2, seen_by


def test_every_writer_is_here_and_the_page_names_its_readers() -> None:
    """The Evolver's files have one reader in the world, the Evolver: see test_evolver."""
    endings = set(WRITERS) | {".pvd"}
    assert endings - {".fe", ".hdf5"} <= set(READERS)
    assert {key for key, _, _ in CASES.values()} == set(READERS)
    assert all(len(programs) >= 2 for programs in READERS.values())
    page = (Path(__file__).parents[1] / "docs/formats.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\| `\.", line)]
    named = {ending for row in rows for ending in re.findall(r"`(\.\w+)`", row.split("|")[1])}
    assert endings - {".hdf5"} <= named
    for row in rows:
        cells = row.split("|")
        for ending in re.findall(r"`(\.\w+)`", cells[1]):
            for program in READERS.get(ending, {}):
                if program not in ("struct", "csv"):  # these are this file's own
                    assert program in cells[5], f"docs/formats.md does not name {program} for {ending}"


def test_a_wrong_number_would_be_seen(tmp_path: Path) -> None:
    """The comparison fails on one digit of one value."""
    foam = FOAMS["sphere"]()
    path = wf.write_bubbles_csv(tmp_path / "bubbles.csv", foam)
    digits = repr(float(foam.bubble_areas[7]))
    changed = digits[:-1] + ("1" if digits[-1] != "1" else "2")
    path.write_text(path.read_text().replace(digits, changed))
    for read in READERS[".csv"].values():
        assert read(path)["area"][7] != foam.bubble_areas[7]
        assert np.delete(read(path)["area"], 7).tolist() == np.delete(foam.bubble_areas, 7).tolist()
