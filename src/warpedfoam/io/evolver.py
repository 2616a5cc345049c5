"""Surface Evolver: foams as its datafiles, so that another program can check ours."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from warpedfoam.arrays import as_choice, as_instance, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.io.evolver_forms import rest_of
from warpedfoam.io.evolver_formulas import Formulas, formulas_of
from warpedfoam.io.evolver_levels import level_formulas, level_tree
from warpedfoam.io.evolver_sheets import sheets
from warpedfoam.io.evolver_strings import strings

MODELS = ("ruled", "string", "soapfilm")


def write_fe(path: PathLike, foam: Foam, *, model: str = "ruled", segments: int = 4, layers: int = 1) -> Path:
    """Write ``foam`` as a datafile of Brakke's Surface Evolver.

    *String models*. Films become chains of straight edges whose vertices lie on the inner plate, a
    constraint given by its formula. A vertex inside a film stays on a plane across the film (a constraint
    with the vertex attribute ``side``): without it vertices slide along films to gain length, which is an
    error of the discretisation and not of the foam. Volumes are named quantities ``bubble_<id>``: integrals
    of a one-form along edges, with the form's cut on the far side of the surface.

    *Soapfilm model*. Films become curved triangles (quadratic elements) from plate to plate, whose edges
    slide on both plates, each a constraint by its formula, so that they end at right angles; they may bulge
    as those of ``relax(foam, layers=4)``. Volumes are fluxes through films of a vector field of divergence
    1 that runs along the plates.

    The exterior, or else the last bubble, has no quantity, because the others fix its volume; pressures are
    relative to it. Motions of the surface into itself are pinned. On surfaces without closed forms the
    one-forms are polynomials that are fitted bubble by bubble, to 1e-6.

    The energy and the volumes of a string model converge to those of ``foam.energy`` and
    ``target_volumes`` like segments⁻², those of the soapfilm model to the bulging foam's like segments⁻⁴
    (Richardson's extrapolation of two files gains two orders). In the Evolver::

        m 0; g 1; hessian; hessian; hessian; dump "foam.dmp"

    computes pressures, solves, and writes what `read_dmp` reads; ``r`` refines the soapfilm model.

    Parameters
    ----------
    path : str or path
        Ends in ``.fe``.
    foam : Foam
        All its bubbles disks, but for an exterior. String models: on a `Sphere`, `Torus`, `Cylinder`,
        `Catenoid`, `Ellipsoid`, `FlatTorus` or `SchwarzP` (these two in the Evolver's torus model), or an
        `Implicit`, `Graph` or `Revolution` that was made by ``from_formula``. Soapfilm model: on those whose
        outer plate has a formula too, a `Sphere`, `Torus`, `Cylinder` or `FlatTorus`.
    model : {"ruled", "string", "soapfilm"}, optional
        ``"ruled"`` (default): films as this package has them, γ ∫∫ |(I + tW)T| ds dt, with Gauss points in
        t, and Steiner's volumes. ``"string"``: leading order in the gap d, γ d times length and d times
        area. ``"soapfilm"``: films free to bulge.
    segments : int, optional
        Edges per film, at least 1.
    layers : int, optional
        Edges from plate to plate in the soapfilm model, at least 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If the surface has no formulas here, the gap varies, a bubble is no disk or too large for its form,
        or the name does not end in ``.fe``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    References
    ----------
    K. A. Brakke, The Surface Evolver, Experimental Mathematics 1, 141–165 (1992), and its manual, version
    2.70: chapters on datafiles, named quantities, the string, soapfilm and torus models.

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
    rows = as_integer(layers, "layers", minimum=1, maximum=1000)
    foam.cell.parallel_gap("write_fe")
    odd = foam.network.bubble_euler != 1
    odd[rest_of(foam)] &= foam.exterior is None
    if odd.any():
        bad = int(np.argmax(odd))
        raise ValueError(f"foam must consist of disks, but bubble {bad} is none: its volume is no one-form")
    tree, ruled = level_tree(foam.cell.surface), kind != "string"
    formulas = formulas_of(foam, ruled=ruled) if tree is None else level_formulas(foam, tree, ruled=ruled)
    if kind == "soapfilm" and (formulas.outer is None or formulas.flux is None):
        raise ValueError(
            f"the soapfilm model needs a formula of the outer plate, which is none over a "
            f"{type(foam.cell.surface).__name__}; use model='ruled'"
        )
    head = _head(foam, formulas, kind)
    body = sheets(foam, formulas, n, rows) if kind == "soapfilm" else strings(foam, formulas, n)
    with atomic_text(target) as stream:
        stream.writelines(f"{line}\n" for line in head)
        stream.writelines(f"{line}\n" for line in body)
        # without it fewer than 50 volumes are eliminated from a Hessian that may be singular by itself
        stream.write("\nread\naugmented_hessian on\n")
    return target


def _head(foam: Foam, formulas: Formulas, model: str) -> Iterable[str]:
    rest, period = rest_of(foam), foam.cell.surface.period
    last = foam.bubble_ids[rest]
    yield f"// {foam.n_bubbles} bubbles between plates {foam.cell.mean_gap!r} apart, written by warpedfoam"
    yield f"// pressures are relative to bubble_{last}, whose volume follows from the others'"
    if model == "soapfilm":
        yield from ("soapfilm", "quadratic", "space_dimension 3", "integral_order_2D 10")
    else:
        yield from (
            "string",
            "space_dimension 3",
            "integral_order_1D 8",
            "define vertex attribute side real[4]",
        )
    # what dumps keep, and import_polygons looks for
    facts = {"vertices": foam.network.n_vertices, "rest": rest, "exterior": int(foam.exterior is not None)}
    yield from (f"parameter foam_{name} = {value}" for name, value in facts.items())
    if period is not None:
        # directions without a period get one that nothing crosses
        box = np.where(np.isfinite(period), period, 4.0 * foam.cell.surface.size + 4.0 * foam.cell.mean_gap)
        yield from ("torus", "periods", *(" ".join(map(repr, row)) for row in np.diag(box).tolist()))
    yield from ("", "constraint 1", f"formula: {formulas.surface}", "constraint 2")
    if model == "soapfilm":
        yield f"formula: {formulas.outer}"
    else:
        yield "formula: side[1]*x + side[2]*y + side[3]*z = side[4]"
    extra = [equation for equation, _ in formulas.rims]
    extra += [
        " + ".join(f"({a!r})*{e}" for a, e in zip(normal.tolist(), "xyz", strict=True))
        + f" = {float(normal @ foam.vertex_points[vertex])!r}"
        for vertex, normal in formulas.pinned
    ]
    for place, equation in enumerate(extra):
        yield from (f"constraint {place + 3}", f"formula: {equation}")
    if formulas.energy is not None and model != "soapfilm":
        yield from (
            "",
            "quantity film_energy energy global_method edge_general_integral",
            f"scalar_integrand: {formulas.energy}",
        )
    targets = (foam.target_volumes * (formulas.volume / foam.cell.volume)).tolist()
    for place in range(foam.n_bubbles):
        if place == rest:
            continue
        start = f"quantity bubble_{foam.bubble_ids[place]} fixed = {targets[place]!r} method"
        form = formulas.one_form(place)
        if model == "soapfilm":
            assert formulas.flux is not None
            form, start = formulas.flux(place), f"{start} facet_vector_integral"
        else:
            start = f"{start} edge_vector_integral"
        yield from ("", start, "vector_integrand:", *(f"q{k + 1}: {part}" for k, part in enumerate(form)))
    yield ""
