"""Commands that relax and draw a saved foam."""

from __future__ import annotations

from typing import Annotated

import typer

from warpedfoam.cli.ending import NOT_CONVERGED, answer, ending_well, say, signals
from warpedfoam.cli.examples import epilog
from warpedfoam.cli.flags import (
    COLORS,
    OUTPUT,
    SOLVER,
    Color,
    Debug,
    FoamFile,
    Folder,
    Frame,
    Json,
    Picture,
    Quiet,
)
from warpedfoam.cli.progress import progress_bars

foam_verbs = typer.Typer()


@foam_verbs.command(epilog=epilog("relax"))
def relax(
    file: FoamFile,
    out: Folder = "relaxed",
    order: Annotated[
        int | None, typer.Option("--order", help="Polynomial order of the films; the foam's own if left out.")
    ] = None,
    layers: Annotated[
        int, typer.Option("--layers", help="Layers of the films, 1 to 8: 1 ruled, more let them bulge.")
    ] = 1,
    t1: Annotated[bool, typer.Option("--t1/--no-t1", help="Let films turn (T1) while relaxing.")] = True,
    tolerance: Annotated[
        float, typer.Option("--tolerance", help="Largest force left, in tension times gap.")
    ] = 1e-10,
    max_iterations: Annotated[int, typer.Option("--max-iterations", help="Most steps.")] = 1000,
    solver: Annotated[
        str, typer.Option("--solver", help="auto, superlu or pardiso.", autocompletion=SOLVER)
    ] = "auto",
    frame: Frame = -1,
    color_by: Color = "charge",
    picture: Picture = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Relax a saved foam: films of higher order, films that bulge, or on from where a run stopped."""
    with ending_well(debug), signals():
        from warpedfoam.cli.relaxing import relax_file
        from warpedfoam.cli.relaxing import summary_text as told

        with progress_bars(quiet=quiet) as report:
            job = relax_file(
                file,
                frame=frame,
                out=out,
                order=order,
                layers=layers,
                t1=t1,
                tolerance=tolerance,
                max_iterations=max_iterations,
                solver=solver,
                color_by=color_by,
                picture=picture,
                progress=report,
            )
        answer(job.summary, lambda: told(job.record), as_json=as_json, quiet=quiet)
    if not job.relaxation.converged:
        say(f"did not converge: {job.relaxation.message}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)


def _projections() -> list[str]:
    from warpedfoam.plot.maps.charts import GLOBE, PLANE, TURNED

    return list(dict.fromkeys((*GLOBE, *TURNED, *PLANE)))


def _kinds() -> list[str]:
    from warpedfoam.cli.plotting import KINDS

    return list(KINDS)


def _quantities() -> list[str]:
    from warpedfoam.plot.histograms import QUANTITIES

    return list(QUANTITIES)


@foam_verbs.command(epilog=epilog("plot"))
def plot(
    file: FoamFile,
    out: Annotated[
        str | None,
        typer.Option(*OUTPUT, help="Picture: PNG, SVG or PDF by its ending; beside the foam if left out."),
    ] = None,
    kind: Annotated[
        str,
        typer.Option("--kind", help="foam, map, defects, order, histogram or sides.", autocompletion=_kinds),
    ] = "foam",
    color_by: Annotated[
        str | None,
        typer.Option(
            "--color-by",
            help="Colour foam or map by charge, pressure, sides, area, volume or curvature.",
            autocompletion=COLORS,
        ),
    ] = None,
    projection: Annotated[
        str | None,
        typer.Option(
            "--projection",
            help="Of a map: angles, equal_area, conformal; hammer, equirectangular, stereographic; plane.",
            autocompletion=_projections,
        ),
    ] = None,
    outline: Annotated[bool, typer.Option("--outline", help="Outline clusters of defects on a map.")] = False,
    vertices: Annotated[bool, typer.Option("--vertices", help="Mark the vertices on a map.")] = False,
    of: Annotated[
        str | None,
        typer.Option(
            "--of",
            help="Histogram of sides, charge, area, volume, pressure, curvature, film_length, film_area "
            "or angle.",
            autocompletion=_quantities,
        ),
    ] = None,
    view: Annotated[
        str | None, typer.Option("--view", metavar="EL,AZ", help="Elevation and azimuth in degrees.")
    ] = None,
    width: Annotated[
        float | None, typer.Option("--width", help="Width in print, in mm: 86 for one column.")
    ] = None,
    title: Annotated[str | None, typer.Option("--title", help="Heading of the picture.")] = None,
    dpi: Annotated[int, typer.Option("--dpi", help="Dots per inch of a PNG.")] = 160,
    frame: Frame = -1,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Draw a saved foam: on its surface, as a map, its defects, or a histogram."""
    with ending_well(debug), signals():
        from warpedfoam.cli.plotting import plot_file

        options = {
            "color_by": color_by,
            "projection": projection,
            "outline": outline,
            "vertices": vertices,
            "of": of,
            "view": view,
            "width": width,
            "title": title,
        }
        facts = plot_file(file, frame=frame, kind=kind, out=out, dpi=dpi, options=options)
        size = f"{facts['width_mm']:.0f} by {facts['height_mm']:.0f} mm"
        answer(facts, lambda: f"written   {facts['picture']} ({size})", as_json=as_json, quiet=quiet)
