"""The commands; each turns its arguments into `Options` and runs the main job."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

from warpedfoam.cli.ending import NOT_CONVERGED, answer, ending_well, say, signals
from warpedfoam.cli.examples import EXAMPLES, epilog
from warpedfoam.cli.flags import (
    CELLS,
    METHOD,
    OUTPUT,
    SEEDS,
    Color,
    Debug,
    Folder,
    Json,
    Picture,
    Quiet,
    Seed,
)
from warpedfoam.cli.foam_verbs import foam_verbs
from warpedfoam.cli.groups import OneLine, SurfaceOrFile
from warpedfoam.cli.motion_verbs import motion_verbs
from warpedfoam.cli.progress import progress_bars
from warpedfoam.cli.verbs import verbs

app = typer.Typer(
    cls=OneLine,
    help="Bubbles and foams trapped between curved plates.",
    epilog="Exit codes: 0 converged, 1 not converged (results written all the same), 2 bad input, "
    "3 a fault of warpedfoam's own, 130 interrupted.\n\n"
    + epilog("", *EXAMPLES[""], "warpedfoam --install-completion"),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


foam_app = typer.Typer(
    cls=SurfaceOrFile,
    help="Build and relax a foam on a surface given here: its name, or that of a mesh file (foam thing.ply).",
    epilog=epilog("foam"),
    no_args_is_help=True,
)
app.add_typer(foam_app, name="foam")
app.add_typer(foam_verbs)
app.add_typer(verbs)
app.add_typer(motion_verbs)

Count = Annotated[int, typer.Option("-n", "--n-bubbles", help="Number of bubbles.")]
Gap = Annotated[float, typer.Option("--gap", help="Distance between the plates.")]
Seeds = Annotated[
    str,
    typer.Option("--seeds", help="Where bubbles start: random, blue or lattice.", autocompletion=SEEDS),
]
Cells = Annotated[
    str,
    typer.Option(
        "--cells",
        help="Start from voronoi cells, or power cells of the right volumes.",
        autocompletion=CELLS,
    ),
]
Lloyd = Annotated[int, typer.Option("--lloyd", help="Sweeps that even out the bubbles before relaxing.")]
Volumes = Annotated[
    float | None,
    typer.Option("--volumes", help="Log-normal width of the bubbles' volumes; equal volumes if left out."),
]
Order = Annotated[int, typer.Option("--order", help="Polynomial order of the films.")]
T1 = Annotated[bool, typer.Option("--t1/--no-t1", help="Let films turn (T1) while relaxing.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"warpedfoam {version('warpedfoam')}")
        raise typer.Exit


Version = Annotated[
    bool,
    typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version),
]


@app.callback()
def _common(version: Version = False) -> None:
    pass  # the option's callback has done the work


@app.command(epilog=epilog("run"))
def run(
    file: Annotated[str, typer.Argument(help="TOML file of options.", metavar="FOAM.TOML")],
    out: Annotated[str | None, typer.Option(*OUTPUT, help="Folder for the results.")] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Replace an option, such as foam.n_bubbles=500."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Random seed.")] = None,
    picture: Annotated[
        bool | None,
        typer.Option("--picture/--no-picture", help="Draw pictures too; as the file says if left out."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Build and relax the foam that a TOML file describes."""

    def options() -> Any:
        from warpedfoam.studies.options import read_options

        overrides = list(sets or [])
        if out is not None:
            overrides.append(f"output.folder={json.dumps(out)}")
        if seed is not None:
            overrides.append(f"seed={seed}")
        if picture is not None:
            overrides.append(f"output.picture={json.dumps(picture)}")
        return read_options(file, overrides)

    _run(options, as_json=as_json, quiet=quiet, debug=debug)


potential_app = typer.Typer(
    cls=SurfaceOrFile,
    help="Map the energy of one bubble over its place on a surface, given as for foam.",
    epilog=epilog("potential"),
    no_args_is_help=True,
)
app.add_typer(potential_app, name="potential")


def _add_surface(kind: str, about: str, helps: Mapping[str, str]) -> None:
    """Add ``foam KIND`` and ``potential KIND``: the surface's sizes, then the options all surfaces share."""

    def run_foam(surface: dict[str, Any], given: Mapping[str, Any]) -> None:
        flags = {name: given[name] for name in ("as_json", "quiet", "debug")}
        _run(lambda: _checked(_values(surface, given)), **flags)

    _add_command(foam_app, kind, about, helps, SHARED, run_foam)
    place = about.replace("A foam", "The potential of a bubble")
    _add_command(potential_app, kind, place, helps, POTENTIAL, _potential_run)


def _add_command(
    group: typer.Typer,
    kind: str,
    about: str,
    helps: Mapping[str, str],
    shared: Mapping[str, tuple[Any, Any]],
    do: Callable[[dict[str, Any], Mapping[str, Any]], None],
) -> None:
    from warpedfoam.sizes import SIZES

    sizes = SIZES[kind]
    plain = inspect.Parameter.KEYWORD_ONLY
    parameters = []
    for name, default in sizes.items():
        if isinstance(default, str) and not default:
            note: Any = typer.Argument(help=helps[name], metavar="MESH")
            parameters.append(inspect.Parameter(name, plain, annotation=Annotated[str, note]))
        elif isinstance(default, str):
            words = Annotated[str, typer.Option(help=helps[name])]
            parameters.append(inspect.Parameter(name, plain, default=default, annotation=words))
        else:
            option = Annotated[float, typer.Option(help=helps[name])]
            parameters.append(inspect.Parameter(name, plain, default=default, annotation=option))
    parameters += [
        inspect.Parameter(name, plain, default=default, annotation=annotation)
        for name, (annotation, default) in shared.items()
        if name != "along" or kind == "torus"
    ]
    if kind == "mesh":
        # who knows in which unit a file is
        parameters = [p.replace(default=p.empty) if p.name in ("gap", "volume") else p for p in parameters]

    def command(**given: Any) -> None:
        do({"kind": kind, **{name: given[name] for name in sizes}}, given)

    command.__doc__ = about
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    what = "potential" if "volume" in shared else "foam"
    name = kind.replace("_", "-")
    given = "data/double_torus.ply" if kind == "mesh" else name
    options = "--volume 0.5 --gap 0.5" if what == "potential" else "-n 200 --gap 0.5 --seed 1"
    group.command(name=name, epilog=epilog("", f"warpedfoam {what} {given} {options} -o out/"))(command)


def _potential_run(surface: dict[str, Any], given: Mapping[str, Any]) -> None:
    with ending_well(given["debug"]), signals():
        from warpedfoam.cli.potentials import all_at_rest, map_potential
        from warpedfoam.cli.potentials import summary_text as told

        facts = map_potential(surface, given)
        if given["as_json"] or not given["quiet"]:
            print(json.dumps(facts, allow_nan=False) if given["as_json"] else told(facts), flush=True)
    if not all_at_rest(facts):
        say("some bubbles do not come to rest: they are blank in the table")
        raise typer.Exit(NOT_CONVERGED)


#: Options of every surface, with their defaults.
SHARED: Mapping[str, tuple[Any, Any]] = {
    "n_bubbles": (Count, 200),
    "gap": (Gap, 0.5),
    "seed": (Seed, 0),
    "seeds": (Seeds, "random"),
    "cells": (Cells, "voronoi"),
    "lloyd": (Lloyd, 0),
    "volumes": (Volumes, None),
    "order": (Order, 4),
    "t1": (T1, True),
    "color_by": (Color, "charge"),
    "picture": (Picture, True),
    "out": (Folder, "out"),
    "as_json": (Json, False),
    "quiet": (Quiet, False),
    "debug": (Debug, False),
}
#: The same of ``potential``.
POTENTIAL: Mapping[str, tuple[Any, Any]] = {
    "volume": (Annotated[float, typer.Option("--volume", help="Volume of the bubble.")], 0.5),
    "gap": (Gap, 0.5),
    "method": (
        Annotated[
            str,
            typer.Option(
                "--method", help="theory, ruled or free (3D films); several by commas.", autocompletion=METHOD
            ),
        ],
        "theory",
    ),
    "points": (Annotated[int, typer.Option("--points", help="About so many places all over it.")], 300),
    "along": (
        Annotated[int | None, typer.Option("--along", help="Instead, so many places from phi = 0 to 180.")],
        None,
    ),
    "layers": (Annotated[int, typer.Option("--layers", help="Layers of free films, 2 to 12.")], 4),
    "picture": (Picture, True),
    "out": (Folder, "out"),
    "as_json": (Json, False),
    "quiet": (Quiet, False),
    "debug": (Debug, False),
}
_add_surface(
    "torus",
    "A foam between two tori; normals point out of the tube, the gap lies outside.",
    {"major_radius": "Radius of the ring.", "minor_radius": "Radius of the tube."},
)
_add_surface("sphere", "A foam between two concentric spheres.", {"radius": "Radius of the inner plate."})
_add_surface(
    "ellipsoid",
    "A foam between an ellipsoid and its parallel surface.",
    {"a": "Semi-axis along x.", "b": "Semi-axis along y.", "c": "Semi-axis along z."},
)
_add_surface(
    "cylinder",
    "A foam between two coaxial cylinders whose ends are joined.",
    {"radius": "Radius of the inner plate.", "height": "Period along the axis."},
)
_add_surface(
    "open_cylinder",
    "A foam between two coaxial cylinders that end in rims.",
    {"radius": "Radius of the inner plate.", "height": "Height between the rims."},
)
_add_surface(
    "catenoid",
    "A foam between a catenoid with two rims and its parallel surface.",
    {"neck_radius": "Radius of the neck.", "height": "Height between the rims."},
)
_add_surface(
    "flat_torus",
    "A foam between two flat plates, repeating in both directions.",
    {"width": "Period along x.", "height": "Period along y."},
)
_add_surface(
    "schwarz_p",
    "A foam on one translational unit of Schwarz's P surface, repeating in space.",
    {"cell_length": "Period along x, y and z."},
)
_add_surface(
    "implicit",
    "A foam between the closed surface where a formula is 0, and its parallel surface.",
    {
        "formula": "Of x, y and z; it grows into the gap, such as 'x**2 + y**2/2 + z**4 - 100'.",
        "bounds": "Two corners of a box round the surface, six numbers.",
    },
)
_add_surface(
    "graph",
    "A foam between the landscape z = formula over a rectangle or a disk, and its parallel surface.",
    {
        "formula": "Of x and y.",
        "width": "Side along x, or diameter.",
        "height": "Side along y, or diameter.",
        "edge": "rim: it ends there; joined: its sides are joined; disk: a round rim.",
    },
)
_add_surface(
    "revolution",
    "A foam between the turned surface x**2 + y**2 = formula, and its parallel surface.",
    {
        "formula": "Of z: the square of the radius, 0 at a pole.",
        "bottom": "Height of the lower end.",
        "top": "Height of the upper end.",
    },
)
_add_surface(
    "mesh",
    "A foam between the smooth surface through a mesh, closed or with rims, and its parallel surface.",
    {"file": "Triangle mesh: PLY, OBJ, STL, OFF, GLB."},
)


def _values(surface: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments in the shape of a TOML file."""
    foam = {name: given[name] for name in ("n_bubbles", "seeds", "cells", "lloyd")}
    return {
        "seed": given["seed"],
        "surface": surface,
        "cell": {"gap": given["gap"]},
        "foam": foam if given["volumes"] is None else {**foam, "volumes": given["volumes"]},
        "relax": {"order": given["order"], "t1": given["t1"]},
        "output": {"folder": given["out"], "color_by": given["color_by"], "picture": given["picture"]},
    }


def _checked(values: Mapping[str, Any]) -> Any:
    from warpedfoam.studies.options import options_from

    return options_from(values, "command line")


def _run(options: Callable[[], Any], *, as_json: bool, quiet: bool, debug: bool) -> None:
    """Run the main job, say how it went, and end with the exit code that belongs to it."""
    with ending_well(debug), signals():
        from warpedfoam.cli.job import run_job

        chosen = options()
        if not quiet:
            _warn_of_small_rims(chosen)
        with progress_bars(quiet=quiet) as report:
            job = run_job(chosen, report)
        answer(job.summary, lambda: summary_text(job.record), as_json=as_json, quiet=quiet)
    if not job.relaxation.converged:
        say(f"did not converge: {job.relaxation.message}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)


def _warn_of_small_rims(options: Any) -> None:
    """Before a long run that will hardly converge, say so: holes that are damage look like rims."""
    from warpedfoam.surfaces import MeshSurface
    from warpedfoam.surfaces.health import small_rims

    surface, count = options.plates.surface, options.n_bubbles
    if isinstance(surface, MeshSurface) and count is not None and (small := small_rims(surface.mesh, count)):
        node, around = small[0]
        say(
            f"note: the mesh has a hole at node {node}, {around:.3g} round, too small for bubbles "
            f"{(surface.area / count) ** 0.5:.3g} wide to end on: the foam may not converge. If damage: "
            f"warpedfoam check {options.surface.sizes['file']} --repair mended.ply --close-holes 20"
        )


def summary_text(record: Mapping[str, Any]) -> str:
    """A few lines for a reader, from a run record."""
    options, times = record["options"], record["timings"]
    surface = dict(options["surface"])
    kind = surface.pop("kind")
    sizes = ", ".join(
        f"{name.replace('_', ' ')} {value if isinstance(value, str) else f'{value:g}'}"
        for name, value in surface.items()
    )
    state = "converged" if record["converged"] else "NOT CONVERGED"
    sides = "   ".join(f"{n}: {count}" for n, count in record["sides"].items())
    outputs = list(record["outputs"].values())
    return "\n".join(
        [
            f"foam      {record['n_bubbles']} bubbles on a {kind} ({sizes}), "
            f"gap {options['cell']['gap']:g}, seed {record['seed']}",
            f"state     {state} after {record['iterations']} steps and {record['n_t1']} T1s, "
            f"residual {_number(record['residual'])}, volume error {_number(record['volume_error'])}",
            f"energy    {_number(record['energy'], 10)}, films {_number(record['length_over_honeycomb'], 5)} "
            "times as long as the bound of the flat honeycomb",
            f"sides     {sides}   (charges add up to {record['sum_of_charges']} "
            f"= 6 x {record['euler_characteristic']})",
            f"time      {times['build']:.1f} s building, {times['relax']:.1f} s relaxing, "
            f"{times['write']:.1f} s writing",
            f"written   {', '.join(outputs)}",
        ]
    )


def _number(value: float | None, digits: int = 2) -> str:
    return "unknown" if value is None else f"{value:.{digits}g}"
