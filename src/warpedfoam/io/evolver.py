"""Surface Evolver: foams as its datafiles, so that another program can check ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpedfoam.arrays import Floats, as_choice, as_instance, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.io.evolver_formulas import Formulas, formulas_of

MODELS = ("ruled", "string")


def write_fe(path: PathLike, foam: Foam, *, model: str = "ruled", segments: int = 4) -> Path:
    """Write ``foam`` as a datafile of Brakke's Surface Evolver (string model).

    Films become chains of straight edges whose vertices lie on the inner plate, a constraint given by its
    formula. A vertex inside a film stays on a plane across the film (a constraint with the vertex
    attribute ``side``): without it vertices slide along films to gain length, which is an error of the
    discretisation and not of the foam. Volumes are named quantities ``bubble_<id>``: integrals
    of a one-form along edges, with the form's cut on the far side of the surface. The last bubble has none,
    because the others fix its volume; pressures are relative to it. Rotations of the surface are pinned.

    The energy and the volumes of the file converge to those of ``foam.energy`` and ``target_volumes`` like
    segments⁻² (Richardson's extrapolation of two files gains two orders). In the Evolver::

        m 0; g 1; hessian; hessian; hessian; dump "foam.dmp"

    computes pressures, solves, and writes what `read_dmp` reads.

    Parameters
    ----------
    path : str or path
        Ends in ``.fe``.
    foam : Foam
        On a `Sphere` or a `Torus`, all its bubbles disks.
    model : {"ruled", "string"}, optional
        ``"ruled"`` (default): films as this package has them, γ ∫∫ |(I + tW)T| ds dt, with Gauss points in
        t, and Steiner's volumes. ``"string"``: leading order in the gap d, γ d times length and d times
        area.
    segments : int, optional
        Edges per film, at least 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If the surface has no formulas here, the gap varies, a bubble is no disk, or the name does not end in
        ``.fe``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    References
    ----------
    K. A. Brakke, The Surface Evolver, Experimental Mathematics 1, 141–165 (1992), and its manual, version
    2.70: chapters on datafiles, named quantities and the string model.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> text = write_fe(pathlib.Path(folder.name) / "foam.fe", foam, segments=2).read_text()
    >>> [line.split(" fixed")[0] for line in text.splitlines() if line.startswith("quantity")]
    ['quantity bubble_0', 'quantity bubble_1', 'quantity bubble_2']
    >>> folder.cleanup()
    """
    target = writable_path(path, suffixes=(".fe",))
    as_instance(foam, "foam", Foam)
    kind = as_choice(model, "model", MODELS)
    n = as_integer(segments, "segments", minimum=1, maximum=1000)
    foam.cell.parallel_gap("write_fe")
    if (foam.network.bubble_euler != 1).any():
        bad = int(np.flatnonzero(foam.network.bubble_euler != 1)[0])
        raise ValueError(f"foam must consist of disks, but bubble {bad} is none: its volume is no one-form")
    formulas = formulas_of(foam, ruled=kind == "ruled")
    with atomic_text(target) as stream:
        stream.write(
            "\n".join([*_head(foam, formulas), *_vertices(foam, formulas, n), *_edges(foam, formulas, n)])
        )
        # without it fewer than 50 volumes are eliminated from a Hessian that may be singular by itself
        stream.write("\n\nread\naugmented_hessian on\n")
    return target


def _head(foam: Foam, formulas: Formulas) -> list[str]:
    lines = [
        f"// {foam.n_bubbles} bubbles between curved plates {foam.cell.mean_gap!r} apart, "
        "written by warpedfoam",
        f"// pressures are relative to bubble_{foam.bubble_ids[-1]}, whose volume follows from the others'",
        "string",
        "space_dimension 3",
        "integral_order_1D 8",
        "define vertex attribute side real[4]",
        "",
        "constraint 1",
        f"formula: {formulas.surface}",
        "constraint 2",
        "formula: side[1]*x + side[2]*y + side[3]*z = side[4]",
    ]
    if formulas.pin is not None:
        a, b, c = formulas.pin.tolist()
        lines += ["constraint 3", f"formula: ({a!r})*x + ({b!r})*y + ({c!r})*z = 0"]
    if formulas.energy is not None:
        lines += [
            "",
            "quantity film_energy energy global_method edge_general_integral",
            f"scalar_integrand: {formulas.energy}",
        ]
    targets = (foam.target_volumes * formulas.volume_share).tolist()
    for place in range(foam.n_bubbles - 1):
        form = formulas.one_form(place)
        lines += [
            "",
            f"quantity bubble_{foam.bubble_ids[place]} fixed = {targets[place]!r} "
            "method edge_vector_integral",
            "vector_integrand:",
            *(f"q{k + 1}: {part}" for k, part in enumerate(form)),
        ]
    return [*lines, ""]


def _vertices(foam: Foam, formulas: Formulas, segments: int) -> list[str]:
    """The foam's vertices, then film by film those between."""
    held = dict.fromkeys(formulas.on_pin, " constraint 1 3") | dict.fromkeys(formulas.fixed, " fixed")
    rows = [
        f"{k + 1} {x!r} {y!r} {z!r}{held.get(k, ' constraint 1')}"
        for k, (x, y, z) in enumerate(foam.vertex_points.tolist())
    ]
    between, along = _inner_points(foam, segments)
    offset = np.einsum("fkx,fkx->fk", between, along)
    numbers = np.concatenate([between, along, offset[:, :, None]], axis=2).reshape(-1, 7)
    start = len(rows) + 1
    rows += [
        f"{start + k} {x!r} {y!r} {z!r} constraint 1 2 side {{{a!r}, {b!r}, {c!r}, {d!r}}}"
        for k, (x, y, z, a, b, c, d) in enumerate(numbers.tolist())
    ]
    return ["vertices", *rows, ""]


def _inner_points(foam: Foam, segments: int) -> tuple[Floats, Floats]:
    """Points inside each film and unit vectors along it there, two (n_films, segments − 1, 3) arrays.

    Chords of a parabola cut off 1/segments² of the area under it, so the points lie that much farther
    out: the file starts near its volumes.
    """
    xi = np.arange(1, segments) / segments
    step = 0.25 / segments
    tail, head = foam.film_ends
    offsets = foam.film_offsets * (segments**2 / max(segments**2 - 1, 1))
    arcs = foam.cell.surface.arc_points
    points, behind, ahead = (arcs(tail, head, offsets, xi + s) for s in (0.0, -step, step))
    along = ahead - behind
    return points, along / np.linalg.norm(along, axis=2, keepdims=True)


def _edges(foam: Foam, formulas: Formulas, segments: int) -> list[str]:
    network = foam.network
    first = network.n_vertices + 1 + np.arange(network.n_films * (segments - 1)).reshape(-1, segments - 1)
    chains = np.concatenate(
        [network.tails[:, None] + 1, first.reshape(network.n_films, -1), network.heads[:, None] + 1], axis=1
    )
    # the Evolver's own length carries the energy where the films have no density
    density = f" tension {formulas.tension!r}"
    names = [f" bubble_{i}" for i in foam.bubble_ids.tolist()]
    left = [names[b] if b < foam.n_bubbles - 1 else "" for b in network.left.tolist()]
    right = [f"{names[b]} -" if b < foam.n_bubbles - 1 else "" for b in network.right.tolist()]
    rows = ["edges"]
    for film, chain in enumerate(chains.tolist()):
        tail = f" constraint 1{density}{left[film]}{right[film]}"
        rows += [f"{film * segments + k + 1} {chain[k]} {chain[k + 1]}{tail}" for k in range(segments)]
    return rows
