"""Formulas of the pages, written in plain characters, get true subscripts and superscripts: κ_g, e^{−t}.

Pages stay readable as text, and the site needs no typesetting program and no network. Indented blocks
are formulas; commands and code have fences.
"""

from __future__ import annotations

import re

from docutils import nodes
from name_links import ancestors
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

# a short name, or an operator, then an index; or anything raised
INDEX = re.compile(
    r"(?P<base>(?<![^\W\d_])[^\W\d_]{1,2}\d?|[∫∂∮])_(?P<low>\{[^{}]*\}|[^\W_²³⁴⁵⁶⁷⁸⁹]+)"
    r"|\^(?P<high>\{(?:[^{}]|\{[^{}]*\})*\}|[−-]?[^\W_]+)"
)
#: Pages that others write: docstrings have names with underscores, examples are code.
LEFT_ALONE = ("reference/", "gallery/")
#: What text is kept as it is.
KEPT = (nodes.literal, nodes.literal_block, nodes.title, nodes.raw, nodes.comment, nodes.reference,
        nodes.subscript, nodes.superscript)  # fmt: skip


def parts(text: str) -> list[nodes.Node]:
    """Text cut into plain pieces, subscripts and superscripts.

    >>> [node.tagname for node in parts("κ_g = e^{6iθ_f}")]
    ['#text', 'subscript', '#text', 'superscript']
    """
    out: list[nodes.Node] = []
    end = 0
    for found in INDEX.finditer(text):
        low, high = found["low"], found["high"]
        out.append(nodes.Text(text[end : found.start()] + (found["base"] or "")))
        inner = (low or high).removeprefix("{").removesuffix("}")
        out.append((nodes.subscript if low else nodes.superscript)("", "", *parts(inner)))
        end = found.end()
    out.append(nodes.Text(text[end:]))
    return [node for node in out if node.astext()]


class Formulas(SphinxTransform):
    """Set indices in the text of pages, and indented blocks as formulas."""

    # after names have become references
    default_priority = 410

    def apply(self, **_: object) -> None:
        """Titles stay as they are: they are links and names of files too."""
        if self.env.docname.startswith(LEFT_ALONE):
            return
        for block in list(self.document.findall(nodes.literal_block)):
            # a fence names its language
            if block.get("language") in (None, "none", "default"):
                set_ = parts(block.astext().rstrip())
                block.replace_self(nodes.paragraph("", "", *set_, classes=["formula"]))
        for text in list(self.document.findall(nodes.Text)):
            if "_" not in text and "^" not in text:
                continue
            if not any(isinstance(parent, KEPT) for parent in ancestors(text)):
                new = parts(text.astext())
                if len(new) > 1:
                    text.parent.replace(text, new)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_transform(Formulas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
