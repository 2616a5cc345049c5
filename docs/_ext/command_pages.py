"""The page of the command line: the help of every command, as it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reference_pages import write_if_changed

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def write_page(app: Sphinx) -> None:
    """Write docs/reference/command_line.md."""
    import typer
    from typer.cli import get_docs_for_click

    from warpedfoam.cli.app import app as commands

    click = typer.main.get_command(commands)
    text = get_docs_for_click(
        obj=click, ctx=typer.Context(click), name="warpedfoam", title="The command line"
    )
    write_if_changed(Path(app.srcdir) / "reference" / "command_line.md", text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", write_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
