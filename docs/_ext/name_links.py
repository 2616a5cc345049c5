"""Names of the package in the text of pages lead to the reference: `relax`, `wf.relax(foam)`, `Foam`."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

import warpedfoam

#: Public names that are plain words too: linked only as ``wf.save`` or with a bracket.
WORDS = {"load", "save", "theory", "t1", "defects", "correlations"}


def target_of(text: str) -> str | None:
    """The full name that a literal means, or None."""
    found = re.fullmatch(r"(?P<wf>wf\.|warpedfoam\.)?(?P<name>\w+(\.\w+)?)(?P<call>\(.*\))?", text)
    if found is None:
        return None
    first, _, second = found["name"].partition(".")
    if first not in warpedfoam.__all__ or (first in WORDS and not (found["wf"] or found["call"])):
        return None
    item: Any = getattr(warpedfoam, first)
    return None if second and not hasattr(item, second) else f"warpedfoam.{found['name']}"


class LinkNames(SphinxTransform):
    """Wrap inline code that is a public name in a reference."""

    default_priority = 400

    def apply(self, **_: Any) -> None:
        """Docstrings have references of their own; only the pages' text is searched."""
        if self.env.docname.startswith("reference/"):
            return
        for literal in list(self.document.findall(nodes.literal)):
            target = target_of(literal.astext())
            inside = (nodes.reference, pending_xref, nodes.title)
            if target is None or any(isinstance(parent, inside) for parent in ancestors(literal)):
                continue
            link = pending_xref("", refdomain="py", reftype="obj", reftarget=target, refwarn=False,
                                refdoc=self.env.docname, refexplicit=True)  # fmt: skip
            literal.replace_self(link)
            link += literal


def ancestors(node: nodes.Node) -> list[nodes.Node]:
    """From the parent up to the document."""
    out = []
    while node.parent is not None:
        node = node.parent
        out.append(node)
    return out


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_transform(LinkNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
