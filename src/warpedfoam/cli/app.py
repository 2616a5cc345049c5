"""The commands; each turns its arguments into `Options` and runs the main job."""

from __future__ import annotations

import inspect
import json
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import PurePath
from types import FrameType
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from warpedfoam.cli import CLOSED_PIPE
from warpedfoam.cli.progress import progress_bars
from warpedfoam.startup import INTERRUPTED, raise_on_interrupt

NOT_CONVERGED, BAD_INPUT, FAULT = 1, 2, 3

app = typer.Typer(
    help="Bubbles and foams trapped between curved plates.",
    epilog="Exit codes: 0 converged, 1 not converged (results written all the same), 2 bad input, "
    "3 a fault of warpedfoam's own, 130 interrupted.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class SurfaceOrFile(TyperGroup):
    """Takes the name of a mesh file where the name of a surface may stand."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """``foam thing.ply …`` is ``foam mesh thing.ply …``."""
        if args and args[0] not in self.commands and PurePath(args[0]).suffix:
            args = ["mesh", *args]
        return super().resolve_command(ctx, args)


foam_app = typer.Typer(
    cls=SurfaceOrFile,
    help="Build and relax a foam on a surface given here: its name, or that of a mesh file (foam thing.ply).",
    no_args_is_help=True,
)
app.add_typer(foam_app, name="foam")

Count = Annotated[int, typer.Option("-n", "--n-bubbles", help="Number of bubbles.")]
Gap = Annotated[float, typer.Option("--gap", help="Distance between the plates.")]
Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
Seeds = Annotated[str, typer.Option("--seeds", help="Where bubbles start: random, blue or lattice.")]
Cells = Annotated[
    str, typer.Option("--cells", help="Start from voronoi cells, or power cells of the right volumes.")
]
Lloyd = Annotated[int, typer.Option("--lloyd", help="Sweeps that even out the bubbles before relaxing.")]
Volumes = Annotated[
    float | None,
    typer.Option("--volumes", help="Log-normal width of the bubbles' volumes; equal volumes if left out."),
]
Order = Annotated[int, typer.Option("--order", help="Polynomial order of the films.")]
T1 = Annotated[bool, typer.Option("--t1/--no-t1", help="Let films turn (T1) while relaxing.")]
Color = Annotated[str, typer.Option("--color-by", help="Colour by charge, pressure, sides or area.")]
Folder = Annotated[str, typer.Option("-o", "--out", help="Folder for the results.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress and no summary (but --json).")]
Debug = Annotated[bool, typer.Option("--debug", help="On an error print the traceback.")]


class Stopped(BaseException):
    """A signal asked the run to end; raised so that files being written are tidied away."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum


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


@app.command()
def run(
    file: Annotated[str, typer.Argument(help="TOML file of options.", metavar="FOAM.TOML")],
    out: Annotated[str | None, typer.Option("-o", "--out", help="Folder for the results.")] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Replace an option, such as foam.n_bubbles=500."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Random seed.")] = None,
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
        return read_options(file, overrides)

    _run(options, as_json=as_json, quiet=quiet, debug=debug)


potential_app = typer.Typer(
    cls=SurfaceOrFile,
    help="Map the energy of one bubble over its place on a surface, given as for foam.",
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
    from warpedfoam.studies.sizes import SIZES

    sizes = SIZES[kind]
    plain = inspect.Parameter.KEYWORD_ONLY
    parameters = []
    for name, default in sizes.items():
        if isinstance(default, str):
            note: Any = typer.Argument(help=helps[name], metavar="MESH")
            parameters.append(inspect.Parameter(name, plain, annotation=Annotated[str, note]))
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
    group.command(name=kind.replace("_", "-"))(command)


def _potential_run(surface: dict[str, Any], given: Mapping[str, Any]) -> None:
    with _ending_well(given["debug"]), _signals():
        from warpedfoam.cli.potentials import all_at_rest, map_potential
        from warpedfoam.cli.potentials import summary_text as told

        facts = map_potential(surface, given)
        if given["as_json"] or not given["quiet"]:
            print(json.dumps(facts, allow_nan=False) if given["as_json"] else told(facts), flush=True)
    if not all_at_rest(facts):
        _say("some bubbles do not come to rest: they are blank in the table")
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
        Annotated[str, typer.Option("--method", help="theory, ruled or free (3D films); several by commas.")],
        "theory",
    ),
    "points": (Annotated[int, typer.Option("--points", help="About so many places all over it.")], 300),
    "along": (
        Annotated[int | None, typer.Option("--along", help="Instead, so many places from phi = 0 to 180.")],
        None,
    ),
    "layers": (Annotated[int, typer.Option("--layers", help="Layers of free films, 2 to 12.")], 4),
    "picture": (Annotated[bool, typer.Option("--picture/--no-picture", help="Draw the potential.")], True),
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
    "mesh",
    "A foam between the smooth surface through a mesh, closed or with rims, and its parallel surface.",
    {"file": "Triangle mesh: PLY, OBJ, STL, OFF, GLB."},
)


@app.command()
def figures(
    which: Annotated[
        str, typer.Argument(help="paper: the paper's figures and two new ones.", metavar="paper")
    ],
    out: Annotated[str, typer.Option("-o", "--out", help="Folder for the figures.")] = "figs",
    only: Annotated[
        list[str] | None, typer.Option("--only", help="One figure, such as torus; may be repeated.")
    ] = None,
    torus_table: Annotated[
        str | None,
        typer.Option("--torus-table", help="Take films on the torus from this CSV; computed if left out."),
    ] = None,
    layers: Annotated[int, typer.Option("--layers", help="Layers of the films, 2 to 12.")] = 4,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Draw the paper's figures with relaxed 3D films on the theory's lines; their tables as CSV."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.figures import draw_paper
        from warpedfoam.cli.figures import summary_text as told

        if which != "paper":
            raise ValueError(f"there are no figures {which!r}; say: warpedfoam figures paper")
        with progress_bars(quiet=quiet) as report:
            facts = draw_paper(out, only=only, torus_table=torus_table, layers=layers, progress=report)
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else told(facts), flush=True)


@app.command()
def check(
    file: Annotated[str, typer.Argument(help="Triangle mesh: PLY, OBJ, STL, OFF, GLB.", metavar="MESH")],
    gap: Annotated[
        float | None, typer.Option("--gap", help="Also: would plates this far apart fold?")
    ] = None,
    n_bubbles: Annotated[
        int | None, typer.Option("-n", "--n-bubbles", help="Also: fine enough for so many bubbles?")
    ] = None,
    repair: Annotated[
        str | None, typer.Option("--repair", metavar="FILE", help="Write a safely repaired mesh (PLY).")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Tell what is wrong with a mesh and what to do; exit code 1 if it cannot carry a foam."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.checking import check_file

        sound, text, facts = check_file(file, gap=gap, n_bubbles=n_bubbles, repair=repair)
        print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)
    if not sound:
        raise typer.Exit(NOT_CONVERGED)


@app.command()
def defects(
    file: Annotated[str, typer.Argument(help="A saved foam: foam.npz.", metavar="FOAM.NPZ")],
    out: Annotated[
        str | None, typer.Option("-o", "--out", help="Folder for the results; the foam's own if left out.")
    ] = None,
    tiny: Annotated[
        float, typer.Option("--tiny", help="Flag films shorter than this many bubble sizes.")
    ] = 0.1,
    picture: Annotated[bool, typer.Option("--picture/--no-picture", help="Draw the defects.")] = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the defects of a foam: charges, dislocations, scars, pleats; tables and a picture."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.defects import inspect_file, summary_tables, summary_text

        found, facts = inspect_file(file, out=out, tiny=tiny, picture=picture)
        if as_json:
            print(json.dumps(facts, allow_nan=False), flush=True)
        elif not quiet:
            from rich.console import Console

            Console(highlight=False).print(summary_tables(found, facts))
            print(summary_text(facts), flush=True)


FoamFile = Annotated[str, typer.Argument(help="A foam: NPZ, VTP or HDF5 of warpedfoam.", metavar="FOAM")]
Frame = Annotated[int, typer.Option("--frame", help="Frame of a trajectory, from 0; -1 is the last.")]


@app.command()
def convert(
    file: FoamFile,
    targets: Annotated[
        list[str],
        typer.Argument(
            help="Files to write; their endings tell the format: npz, h5, vtp, vtm, ply, glb, obj, "
            "graphml, json, csv, parquet, fe.",
            metavar="OUT...",
        ),
    ],
    color_by: Annotated[
        str | None, typer.Option("--color-by", help="Colour PLY and GLB by charge, pressure, sides or area.")
    ] = None,
    frame: Frame = -1,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a foam in other formats, such as foam.npz to out.vtp for ParaView or out.glb for browsers."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.converting import convert as converted

        text, facts = converted(file, targets, color_by=color_by, frame=frame)
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)


@app.command()
def info(file: FoamFile, frame: Frame = -1, as_json: Json = False, debug: Debug = False) -> None:
    """Tell what foam is in a file: surface, bubbles, sides, energy."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.converting import info as told

        text, facts = told(file, frame=frame)
        print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)


@app.command()
def view(
    files: Annotated[
        list[str],
        typer.Argument(help="Saved foams (foam.npz); several make a trajectory.", metavar="FOAM.NPZ..."),
    ],
    out: Annotated[
        str | None, typer.Option("-o", "--out", help="HTML file; beside the first foam if left out.")
    ] = None,
    color_by: Annotated[
        str,
        typer.Option(
            help="Show first: charge, sides, area, volume, pressure, curvature (of bubbles), surface "
            "(curvature, point by point) or id."
        ),
    ] = "charge",
    title: Annotated[str | None, typer.Option("--title", help="Heading of the page.")] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write one HTML file that shows a foam in 3D in any browser, without a network."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.viewing import view_files

        path, facts = view_files(files, out=out, color_by=color_by, title=title)
        if as_json:
            print(json.dumps(facts, allow_nan=False), flush=True)
        elif not quiet:
            print(f"written   {path} ({facts['bytes'] / 1e6:.2g} MB): open it in a browser", flush=True)


@app.command()
def ensemble(
    file: Annotated[str, typer.Argument(help="TOML file of a study.", metavar="STUDY.TOML")],
    out: Annotated[str, typer.Option("-o", "--out", help="Folder for the results; goes on there.")] = "out",
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes on this machine; 0: none but this one.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="Use this dask scheduler.")
    ] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Replace an option, such as repeats=10."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compute every run of a study into one table; go on where an earlier call ended."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.ensembles import ensemble_text, run_file

        with progress_bars(quiet=quiet) as report:
            facts = run_file(file, out, sets or [], workers=workers, scheduler=scheduler, progress=report)
        if as_json:
            print(json.dumps(facts, allow_nan=False), flush=True)
        elif not quiet:
            print(ensemble_text(facts), flush=True)
    bad = {state: n for state, n in facts["counts"].items() if n and state != "converged"}
    if bad:
        _say(
            ", ".join(f"{n} of {facts['runs']} runs {state}" for state, n in bad.items()) + "; see the table"
        )
        raise typer.Exit(NOT_CONVERGED)


@app.command()
def partition(
    surface: Annotated[
        str, typer.Argument(help="sphere, torus, ellipsoid, ..., or a mesh file.", metavar="SURFACE")
    ],
    n_bubbles: Annotated[int, typer.Option("-n", "--n-bubbles", help="Number of equal areas.")],
    size: Annotated[
        list[str] | None, typer.Option("--size", metavar="NAME=VALUE", help="A size, such as radius=1.")
    ] = None,
    starts: Annotated[int, typer.Option("--starts", help="Starts of the search.")] = 30,
    hops: Annotated[int, typer.Option("--hops", help="Moves tried from each start.")] = 20,
    seed: Seed = 0,
    out: Folder = "out",
    picture: Annotated[bool, typer.Option("--picture/--no-picture", help="Draw the partition.")] = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Search for the shortest films that divide a surface into equal areas; goes on where it was stopped."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli import partition as job

        with progress_bars(quiet=quiet) as report:
            facts = job.search(
                surface,
                size or [],
                n_bubbles,
                seed=seed,
                starts=starts,
                hops=hops,
                out=out,
                picture=picture,
                progress=report,
            )
        if as_json:
            print(json.dumps(facts, allow_nan=False), flush=True)
        elif not quiet:
            print(job.summary_text(facts), flush=True)


def _values(surface: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments in the shape of a TOML file."""
    foam = {name: given[name] for name in ("n_bubbles", "seeds", "cells", "lloyd")}
    return {
        "seed": given["seed"],
        "surface": surface,
        "cell": {"gap": given["gap"]},
        "foam": foam if given["volumes"] is None else {**foam, "volumes": given["volumes"]},
        "relax": {"order": given["order"], "t1": given["t1"]},
        "output": {"folder": given["out"], "color_by": given["color_by"]},
    }


def _checked(values: Mapping[str, Any]) -> Any:
    from warpedfoam.studies.options import options_from

    return options_from(values, "command line")


def _run(options: Callable[[], Any], *, as_json: bool, quiet: bool, debug: bool) -> None:
    """Run the main job, say how it went, and end with the exit code that belongs to it."""
    with _ending_well(debug), _signals():
        from warpedfoam.cli.job import run_job

        chosen = options()
        with progress_bars(quiet=quiet) as report:
            job = run_job(chosen, report)
        if as_json:
            print(json.dumps(job.summary, allow_nan=False), flush=True)
        elif not quiet:
            print(summary_text(job.record), flush=True)
    if not job.relaxation.converged:
        _say(f"did not converge: {job.relaxation.message}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)


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


def _say(text: str) -> None:
    print(f"warpedfoam: {' '.join(text.split())}", file=sys.stderr)


@contextmanager
def _ending_well(debug: bool) -> Iterator[None]:
    """Turn exceptions into one line on stderr and the right exit code."""
    from warpedfoam.errors import ConvergenceError

    try:
        raise_on_interrupt()
        yield
    except KeyboardInterrupt:
        _say("interrupted; no file was left half-written")
        raise typer.Exit(INTERRUPTED) from None
    except Stopped as stop:
        _say("stopped by a signal; no file was left half-written")
        raise typer.Exit(128 + stop.signum) from None
    except BrokenPipeError:
        # the files are written; that nobody reads the summary is no fault
        raise typer.Exit(CLOSED_PIPE) from None
    except Exception as fault:
        bad = isinstance(fault, (ValueError, TypeError, OSError, ImportError))
        if debug or not (bad or isinstance(fault, ConvergenceError)):
            traceback.print_exc()
        if isinstance(fault, OSError) and fault.strerror and fault.filename:
            _say(f"{fault.filename}: {fault.strerror}")
        else:
            _say(str(fault) or type(fault).__name__)
        code = BAD_INPUT if bad else NOT_CONVERGED if isinstance(fault, ConvergenceError) else FAULT
        raise typer.Exit(code) from None


@contextmanager
def _signals() -> Iterator[None]:
    """Raise `Stopped` on SIGTERM and SIGHUP inside the block."""

    def stop(signum: int, _: FrameType | None) -> None:
        raise Stopped(signum)

    names = [s for s in ("SIGTERM", "SIGHUP") if hasattr(signal, s)]
    before = {getattr(signal, s): signal.signal(getattr(signal, s), stop) for s in names}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
