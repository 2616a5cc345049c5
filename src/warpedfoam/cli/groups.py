"""Groups of commands: usage errors in one line, mesh files where a surface's name may stand."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import typer
from typer.core import TyperGroup

from warpedfoam.cli.ending import BAD_INPUT, say

#: What the command line's parser raises; typer has a click of its own, reached by this class only.
PARSER_FAULT: type[Exception] = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")


class OneLine(TyperGroup):
    """Says what is wrong with a call in one line, and where help is."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run; of what the parser raises only a line is shown."""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
        try:
            code = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
        except PARSER_FAULT as fault:
            context: Any = getattr(fault, "ctx", None)
            if type(fault).__name__ == "NoArgsIsHelpError" and context is not None:
                if text := context.get_help():  # rich prints it itself
                    print(text)
                sys.exit(BAD_INPUT)
            where = "warpedfoam" if context is None else context.command_path
            text = fault.format_message()  # type: ignore[attr-defined]
            say(f"{text.strip().rstrip('.')}; see: {where} --help")
            sys.exit(getattr(fault, "exit_code", BAD_INPUT))
        sys.exit(code if isinstance(code, int) else 0)


class SurfaceOrFile(TyperGroup):
    """Takes the name of a mesh file where the name of a surface may stand."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """``foam thing.ply …`` is ``foam mesh thing.ply …``."""
        if args and args[0] not in self.commands and PurePath(args[0]).suffix:
            args = ["mesh", *args]
        return super().resolve_command(ctx, args)
