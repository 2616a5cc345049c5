"""Commands that study, show and convert foams; each hands its arguments to a file of its own."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from warpedfoam.cli.ending import NOT_CONVERGED, answer, ending_well, say, signals
from warpedfoam.cli.examples import epilog
from warpedfoam.cli.flags import (
    COLORS,
    FIGURE,
    LAYOUT,
    OUTPUT,
    SHOWN,
    SURFACE,
    Debug,
    FoamFile,
    Folder,
    Frame,
    Json,
    Picture,
    Quiet,
    Seed,
)
from warpedfoam.cli.progress import progress_bars

verbs = typer.Typer()


@verbs.command(epilog=epilog("figures"))
def figures(
    which: Annotated[
        str, typer.Argument(help="paper: the paper's figures and two new ones.", metavar="paper")
    ],
    out: Annotated[str, typer.Option(*OUTPUT, help="Folder for the figures.")] = "figs",
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="One figure, such as torus; may be repeated.", autocompletion=FIGURE),
    ] = None,
    torus_table: Annotated[
        str | None,
        typer.Option("--torus-table", help="Take films on the torus from this CSV; computed if left out."),
    ] = None,
    layers: Annotated[int, typer.Option("--layers", help="Layers of the films, 2 to 12.")] = 4,
    width: Annotated[
        float | None,
        typer.Option("--width", help="Width in print, in mm: 86 for one column."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Draw the paper's figures with relaxed 3D films on the theory's lines; their tables as CSV."""
    with ending_well(debug), signals():
        from warpedfoam.cli.figures import draw_paper
        from warpedfoam.cli.figures import summary_text as told

        if which != "paper":
            raise ValueError(f"there are no figures {which!r}; say: warpedfoam figures paper")
        with progress_bars(quiet=quiet) as report:
            facts = draw_paper(
                out, only=only, torus_table=torus_table, layers=layers, width=width, progress=report
            )
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else told(facts), flush=True)


@verbs.command(epilog=epilog("check"))
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
    close_holes: Annotated[
        int | None,
        typer.Option("--close-holes", help="Repair closes holes of up to so many edges."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Tell what is wrong with a mesh and what to do; exit code 1 if it cannot carry a foam."""
    with ending_well(debug), signals():
        from warpedfoam.cli.checking import check_file

        sound, text, facts = check_file(
            file, gap=gap, n_bubbles=n_bubbles, repair=repair, close_holes=close_holes
        )
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)
    if not sound:
        raise typer.Exit(NOT_CONVERGED)


@verbs.command(epilog=epilog("defects"))
def defects(
    file: FoamFile,
    out: Annotated[
        str | None, typer.Option(*OUTPUT, help="Folder for the results; the foam's own if left out.")
    ] = None,
    frame: Frame = -1,
    tiny: Annotated[
        float, typer.Option("--tiny", help="Flag films shorter than this many bubble sizes.")
    ] = 0.1,
    picture: Picture = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the defects of a foam: charges, dislocations, scars, pleats; tables and a picture."""
    with ending_well(debug), signals():
        from warpedfoam.cli.defects import inspect_file, summary_tables, summary_text

        found, facts = inspect_file(file, frame=frame, out=out, tiny=tiny, picture=picture)
        if as_json:
            print(json.dumps(facts, allow_nan=False), flush=True)
        elif not quiet:
            from rich.console import Console

            console = Console(highlight=False)
            with console.capture() as tables:  # rich has its own way with a reader that has gone
                console.print(summary_tables(found, facts))
            print(tables.get() + summary_text(facts), flush=True)


@verbs.command(epilog=epilog("convert"))
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
        str | None,
        typer.Option(
            "--color-by",
            help="Colour PLY and GLB by charge, pressure, sides, area, volume or curvature.",
            autocompletion=COLORS,
        ),
    ] = None,
    frame: Frame = -1,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a foam in other formats, such as foam.npz to out.vtp for ParaView or out.glb for browsers."""
    with ending_well(debug), signals():
        from warpedfoam.cli.converting import convert as converted

        text, facts = converted(file, targets, color_by=color_by, frame=frame)
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)


@verbs.command(epilog=epilog("info"))
def info(
    file: FoamFile,
    frame: Frame = -1,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Tell what foam is in a file: surface, bubbles, sides, energy."""
    with ending_well(debug), signals():
        from warpedfoam.cli.converting import info as told

        text, facts = told(file, frame=frame)
        if as_json or not quiet:
            print(json.dumps(facts, allow_nan=False) if as_json else text, flush=True)


@verbs.command(epilog=epilog("view"))
def view(
    files: Annotated[
        list[str],
        typer.Argument(
            help="Foams: NPZ, VTP or HDF5 of warpedfoam; several, or frames, make a trajectory.",
            metavar="FOAM...",
        ),
    ],
    out: Annotated[
        str | None, typer.Option(*OUTPUT, help="HTML file; beside the first foam if left out.")
    ] = None,
    color_by: Annotated[
        str,
        typer.Option(
            "--color-by",
            help="Show first: charge, sides, area, volume, pressure, curvature (of bubbles), surface "
            "(curvature, point by point) or id.",
            autocompletion=SHOWN,
        ),
    ] = "charge",
    title: Annotated[str | None, typer.Option("--title", help="Heading of the page.")] = None,
    frame: Annotated[
        int | None, typer.Option("--frame", help="Only this frame of a trajectory, from 0; -1 is the last.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write one HTML file that shows a foam in 3D in any browser, without a network."""
    with ending_well(debug), signals():
        from warpedfoam.cli.viewing import view_files

        path, facts = view_files(files, out=out, color_by=color_by, title=title, frame=frame)
        written = f"written   {path} ({facts['bytes'] / 1e6:.2g} MB): open it in a browser"
        answer(facts, lambda: written, as_json=as_json, quiet=quiet)


@verbs.command(epilog=epilog("ensemble"))
def ensemble(
    file: Annotated[str, typer.Argument(help="TOML file of a study.", metavar="STUDY.TOML")],
    out: Annotated[str, typer.Option(*OUTPUT, help="Folder for the results; goes on there.")] = "out",
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
    with ending_well(debug), signals():
        from warpedfoam.cli.ensembles import ensemble_text, run_file

        with progress_bars(quiet=quiet) as report:
            facts = run_file(file, out, sets or [], workers=workers, scheduler=scheduler, progress=report)
        answer(facts, lambda: ensemble_text(facts), as_json=as_json, quiet=quiet)
    bad = {state: n for state, n in facts["counts"].items() if n and state != "converged"}
    if bad:
        counts = ", ".join(f"{n} of {facts['runs']} runs {state}" for state, n in bad.items())
        say(f"{counts}; see the table; the first says: {facts['first_reason']}")
        raise typer.Exit(NOT_CONVERGED)


@verbs.command(epilog=epilog("partition"))
def partition(
    surface: Annotated[
        str,
        typer.Argument(
            help="sphere, torus, ellipsoid, ..., or a mesh file.", metavar="SURFACE", autocompletion=SURFACE
        ),
    ],
    n_bubbles: Annotated[int, typer.Option("-n", "--n-bubbles", help="Number of equal areas.")],
    size: Annotated[
        list[str] | None, typer.Option("--size", metavar="NAME=VALUE", help="A size, such as radius=1.")
    ] = None,
    starts: Annotated[int, typer.Option("--starts", help="Starts of the search.")] = 30,
    hops: Annotated[int, typer.Option("--hops", help="Moves tried from each start.")] = 20,
    seed: Seed = 0,
    out: Folder = "out",
    picture: Picture = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Search for the shortest films that divide a surface into equal areas; goes on where it was stopped."""
    with ending_well(debug), signals():
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
        answer(facts, lambda: job.summary_text(facts), as_json=as_json, quiet=quiet)


@verbs.command(epilog=epilog("cluster"))
def cluster(
    surface: Annotated[
        str,
        typer.Argument(
            help="sphere, torus, ellipsoid, ..., or a mesh file.", metavar="SURFACE", autocompletion=SURFACE
        ),
    ],
    n_bubbles: Annotated[
        str, typer.Option("-n", "--n-bubbles", help="Bubbles of the cluster, or of several: 7,3.")
    ] = "7",
    size: Annotated[
        list[str] | None, typer.Option("--size", metavar="NAME=VALUE", help="A size, such as radius=1.")
    ] = None,
    gap: Annotated[float, typer.Option("--gap", help="Distance between the plates.")] = 0.5,
    volume: Annotated[float, typer.Option("--volume", help="Volume of each bubble.")] = 0.5,
    centre: Annotated[
        list[str] | None, typer.Option("--centre", metavar="X,Y,Z", help="Where; once for each cluster.")
    ] = None,
    orientation: Annotated[
        float, typer.Option("--orientation", help="Angle of the long axis in degrees; up a tube is 0.")
    ] = 0.0,
    layout: Annotated[
        str, typer.Option("--layout", help="hexagonal or random.", autocompletion=LAYOUT)
    ] = "hexagonal",
    seed: Seed = 0,
    order: Annotated[int, typer.Option("--order", help="Polynomial order of the films, 2 to 24.")] = 8,
    contacts: Annotated[
        bool, typer.Option("--contacts/--no-contacts", help="Join outlines that meet, part what lets go.")
    ] = True,
    potential: Annotated[
        bool, typer.Option("--potential", help="Hold it at places instead: its energy against where it is.")
    ] = False,
    places: Annotated[
        int, typer.Option("--places", help="With --potential: on a torus from phi = 0 to 180, else all over.")
    ] = 13,
    out: Folder = "out",
    picture: Picture = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Relax a cluster of bubbles in an otherwise empty cell, or measure its energy against its place."""
    with ending_well(debug), signals():
        from warpedfoam.cli import clustering as job

        with progress_bars(quiet=quiet) as report:
            run = job.measure if potential else job.relaxed_cluster
            facts = run(
                surface,
                size or [],
                job.Given(
                    n_bubbles, gap, volume, centre or [], orientation, layout, seed, order, contacts, places
                ),
                out=out,
                picture=picture,
                progress=report,
            )
        answer(facts, lambda: job.summary_text(facts), as_json=as_json, quiet=quiet)
    if not facts["converged"]:
        say(f"did not converge: {facts['message']}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)
