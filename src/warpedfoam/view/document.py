"""`write_view`: the page with its style, scripts and data in one file."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats, as_choice
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.io.colours import CHARGE_RANGE, FILM_COLOUR, OUTSIDE_COLOUR
from warpedfoam.view.chunks import Chunks, in_chunks, parts_of_bubbles
from warpedfoam.view.frames import bounding_cube, frame_arrays, packed
from warpedfoam.view.geometry import Geometry, detail, geometry
from warpedfoam.view.scalars import SCALARS, Scalar, bubble_scalars

# Surfaces that are called otherwise than their classes.
_PROPER = {"SchwarzP": "Schwarz P surface", "Graph": "landscape", "Revolution": "surface of revolution"}
#: Version of the data in the page; its scripts are written beside it and fit.
VERSION = 1
SUFFIXES = (".html", ".htm")
SCRIPTS = ("maths.js", "frames.js", "shaders.js", "painter.js", "gestures.js", "panel.js", "viewer.js")
# Films are pulled towards the eye, so that they do not flicker in the patches that they bound: by this many
# bubble sizes, at most this share of the picture.
_PULL, _MOST_PULL = 0.02, 0.004
# Segments a film and rings a bubble of coarser meshes, beside the finest: with more triangles than these, and
# with more bubbles than these.
_BUSY, _MEDIUM = 30_000, (4, 2)
_MANY, _COARSE = 300, (2, 1)
_VERY_MANY, _COARSEST = 1000, (1, 1)


def write_view(
    path: PathLike,
    foams: Foam | Sequence[Foam],
    *,
    color_by: str = "charge",
    title: str | None = None,
    labels: Sequence[str] | None = None,
) -> Path:
    """Write one HTML file that shows a foam in 3D, or plays a trajectory of foams, in any browser.

    The file needs nothing else: no network, no server, no program but a browser with WebGL 2 (all since
    2023, phones too). Bubbles can be turned, coloured by any scalar, and picked to read their numbers.

    Parameters
    ----------
    path : str or path
        Ends in ``.html`` or ``.htm``.
    foams : Foam or sequence of Foam
        One foam, or the frames of a trajectory. Surfaces, bubbles and topology may differ from frame to
        frame; a picked bubble is followed by its id, and colours mean the same values in all frames.
    color_by : str, optional
        What to show first: ``"charge"``, ``"sides"``, ``"area"``, ``"volume"``, ``"pressure"``,
        ``"curvature"`` (Gaussian, mean of each bubble), ``"surface"`` (Gaussian, point by point),
        ``"gap"`` where it varies, or ``"id"``.
    title : str, optional
        In place of the number of bubbles and the surface.
    labels : sequence of str, optional
        A few words on each frame; its number by default.

    Returns
    -------
    pathlib.Path
        The file written, whole or not at all. The same foams give the same file.

    Raises
    ------
    TypeError
        If ``foams`` holds anything but foams, or texts are no strings.
    ValueError
        If there is no foam, the path has another ending, ``color_by`` is unknown or asks for pressures that
        some foam does not have or a gap that varies where none does, or there are not as many labels as
        foams.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    Notes
    -----
    About 1 kB a bubble and frame for 2000 bubbles; longer trajectories are drawn with fewer triangles.
    Colours are those of `plot_foam`. Each frame holds typed arrays (zlib, base64); positions are rounded
    to 1e-5 of the picture's size, numbers are not rounded.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = write_view(pathlib.Path(folder.name) / "view.html", foam, color_by="area")
    >>> path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    True
    >>> folder.cleanup()
    """
    target = writable_path(path, suffixes=SUFFIXES)
    frames = _frames(foams)
    name = as_choice(color_by, "color_by", SCALARS)
    if name == "pressure" and any(foam.pressures is None for foam in frames):
        raise ValueError(
            "color_by='pressure' needs pressures in every foam: relax them first (warpedfoam.relax)"
        )
    if name == "gap" and all(foam.cell.parallel for foam in frames):
        raise ValueError(
            "color_by='gap' needs plates that are not parallel: here the gap is the same everywhere"
        )
    words = _words(labels, len(frames))
    if title is not None and not isinstance(title, str):
        raise TypeError(f"title must be a string or None, got {type(title).__name__}")
    for text in (title or "", *words):
        if not text.isprintable() and any("\ud800" <= letter <= "\udfff" for letter in text):
            raise ValueError(f"title and labels must be text that UTF-8 can hold, got {text!r}")
    segments, rings = detail(max(foam.n_bubbles for foam in frames), len(frames))
    levels = [_levels(foam, segments, rings) for foam in frames]
    drawn = [_meshes(foam, sizes) for foam, sizes in zip(frames, levels, strict=True)]
    scalars = bubble_scalars(frames, [meshes[0][0].curvature for meshes in drawn])
    cube = bounding_cube([mesh for meshes in drawn for mesh, _ in meshes])
    layouts, texts = [], []
    for number, (foam, meshes) in enumerate(zip(frames, drawn, strict=True)):
        layout, text = packed(frame_arrays(foam, meshes, scalars, number, cube))
        layouts.append(layout)
        texts.append(text)
    facts = {
        "version": VERSION,
        "title": _heading(frames) if title is None else title,
        "colorBy": name,
        "cube": {"low": cube[0].tolist(), "side": cube[1]},
        "view": _first_view(frames[0], drawn[0][0][0]),
        "colours": {"film": FILM_COLOUR, "outside": OUTSIDE_COLOUR, "chargeRange": CHARGE_RANGE},
        "scalars": [_described(scalar) for scalar in scalars],
        "frames": [
            {
                **_frame_facts(foam, meshes, cube[1]),
                "label": word,
                # of each film, mesh by mesh
                "pieces": [pieces for pieces, _ in sizes],
                "layout": layout,
            }
            for foam, meshes, sizes, layout, word in zip(frames, drawn, levels, layouts, words, strict=True)
        ],
    }
    text = page(facts, texts)
    with atomic_text(target) as stream:
        stream.write(text)
    return target


def page(facts: Mapping[str, Any], frames: Sequence[str]) -> str:
    """The document: template, style, scripts, facts as JSON and the frames' bytes."""
    folder = files("warpedfoam.view") / "page"
    scripts = "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)
    # "<" nowhere in the JSON, so that no title ends the script
    data = json.dumps(facts, allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")
    blobs = "\n".join(
        f'<script type="application/octet-stream" id="frame-{k}">{text}</script>'
        for k, text in enumerate(frames)
    )
    parts = {
        "title": html.escape(str(facts["title"])),
        "style": (folder / "style.css").read_text(encoding="utf-8"),
        "facts": data,
        "frames": blobs,
        "scripts": scripts,
    }
    template = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], template)


def _frames(foams: object) -> tuple[Foam, ...]:
    if isinstance(foams, Foam):
        return (foams,)
    if not isinstance(foams, Sequence) or isinstance(foams, (str, bytes)):
        raise TypeError(f"foams must be a Foam or a sequence of Foams, got {type(foams).__name__}")
    if not foams:
        raise ValueError("foams must hold at least one foam, got an empty sequence")
    for k, foam in enumerate(foams):
        if not isinstance(foam, Foam):
            raise TypeError(f"foams[{k}] must be a Foam, got {type(foam).__name__}")
    return tuple(foams)


def _levels(foam: Foam, segments: int, rings: int) -> list[tuple[int, int]]:
    """Segments a film and rings a bubble as it is drawn, and for small bubbles or moving pictures."""
    triangles = 2 * foam.network.n_films * segments * (2 * rings - 1)
    if foam.n_bubbles > _VERY_MANY:
        return [(segments, rings), _COARSE, _COARSEST]
    if foam.n_bubbles > _MANY:
        return [(segments, rings), _COARSE]
    return [(segments, rings), _MEDIUM] if triangles > _BUSY else [(segments, rings)]


def _meshes(foam: Foam, levels: Sequence[tuple[int, int]]) -> list[tuple[Geometry, Chunks]]:
    """The foam in each degree of detail, in parts that are drawn or left out as one."""
    centres = foam.bubble_centres
    normals = foam.cell.surface.normals(centres)
    part = parts_of_bubbles(centres, normals, foam.network.bubble_euler == 1)
    return [in_chunks(geometry(foam, segments, rings), part) for segments, rings in levels]


def _words(labels: object, count: int) -> list[str]:
    if labels is None:
        return [str(k + 1) for k in range(count)]
    if not isinstance(labels, Sequence) or isinstance(labels, (str, bytes)):
        raise TypeError(f"labels must be a sequence of strings, got {type(labels).__name__}")
    if len(labels) != count:
        raise ValueError(f"labels must hold one string per foam: {count} foams, {len(labels)} labels")
    for k, label in enumerate(labels):
        if not isinstance(label, str):
            raise TypeError(f"labels[{k}] must be a string, got {type(label).__name__}")
    return list(labels)


def _heading(foams: Sequence[Foam]) -> str:
    names = sorted({type(foam.cell.surface).__name__ for foam in foams})
    kinds = [_PROPER.get(name) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower() for name in names]
    counts = sorted({_held(foam) for foam in foams})
    bubbles = str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return f"{bubbles} bubbles, {', '.join(kinds)}"


def _held(foam: Foam) -> int:
    """Number of bubbles, an exterior not counted."""
    return foam.n_bubbles - (foam.exterior is not None)


def _least_and_most(values: Sequence[float] | Floats) -> list[float]:
    return [float(min(values)), float(max(values))]


def _first_view(foam: Foam, drawn: Geometry) -> dict[str, float]:
    """Elevation and azimuth in degrees: from the side and a little above, or from above what lies flat.

    Clusters are seen from the front of the first.
    """
    if foam.exterior is not None:
        first = int(foam.exterior == 0)
        x, y, z = foam.cell.surface.normals(foam.bubble_centres[first : first + 1])[0].tolist()
        elevation = float(np.degrees(np.arctan2(z, np.hypot(x, y))))
        # a little from above and from the side, so that the surface is seen to bend
        elevation = min(elevation + 20.0, max(elevation, 70.0))
        return {"elevation": elevation, "azimuth": float(np.degrees(np.arctan2(y, x))) - 15.0}
    extent = np.ptp(drawn.points, axis=0)
    if extent[2] <= 1e-9 * foam.cell.surface.size:
        return {"elevation": 90.0, "azimuth": -90.0}
    low_and_flat = int(np.argmin(extent)) == 2 and foam.cell.surface.euler_characteristic <= 0
    return {"elevation": 48.0 if low_and_flat else 25.0, "azimuth": -60.0}


def _described(scalar: Scalar) -> dict[str, Any]:
    return {
        "name": scalar.name,
        "label": scalar.label,
        "kind": scalar.kind,
        "limits": list(scalar.limits),
        "stops": scalar.stops.tolist(),
    }


def _frame_facts(foam: Foam, meshes: Sequence[tuple[Geometry, Chunks]], side: float) -> dict[str, Any]:
    surface = foam.cell.surface
    return {
        "bubbles": foam.n_bubbles,
        "held": _held(foam),
        "energy": foam.energy,
        "gap": _least_and_most(
            [foam.cell.mean_gap] if foam.cell.parallel else foam.cell.gaps(meshes[0][0].points)
        ),
        "size": foam.bubble_size,
        "pull": min(_PULL * foam.bubble_size, _MOST_PULL * side),
        "sink": max(float(mesh.sunk.max()) for mesh, _ in meshes),
        "meshes": len(meshes),
        # of a surface with edges in the picture the back is seen too
        "edged": surface.period is not None or surface.rim is not None,
    }
