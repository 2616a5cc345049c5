"""Energies and constraints of a foam, with exact first and second derivatives."""

from warpedfoam.energy.film_area import bubble_volumes, film_terms

__all__ = ["bubble_volumes", "film_terms"]
