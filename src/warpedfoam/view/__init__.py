"""The viewer: one HTML file that shows a foam, or a trajectory of foams, in any browser."""

from warpedfoam.view.document import write_view

__all__ = ["write_view"]
