"""`FormulaGap`: a gap written as a formula in x, y and z, with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from warpedfoam.arrays import Floats
from warpedfoam.surfaces.formula import Formula


@dataclass(frozen=True)
class FormulaGap:
    """A gap from a formula: numbers, x, y, z, pi, + - * / ** and common functions.

    Its derivatives are exact, and a foam in it can be saved.

    Parameters
    ----------
    formula : str
        Such as ``"0.5 + 0.01 * x - 0.02 * sin(z / 4)"``, see `Formula`.

    Raises
    ------
    TypeError
        If ``formula`` is no string.
    ValueError
        If it cannot be read or holds something else.

    Examples
    --------
    >>> import numpy as np
    >>> gap = FormulaGap("0.5 + 0.01 * x * z")
    >>> gap(np.array([[2.0, 0.0, 3.0]])).round(12), gap.gradient(np.array([[2.0, 0.0, 3.0]])).round(12)
    (array([0.56]), array([[0.03, 0.  , 0.02]]))
    """

    formula: str

    def __post_init__(self) -> None:
        self.__dict__["_read"] = Formula(self.formula)

    @property
    def _function(self) -> Formula:
        read: Formula = self.__dict__["_read"]
        return read

    def __call__(self, points: Floats) -> Floats:
        """The formula's values, (n,)."""
        return self._function(points)

    def gradient(self, points: Floats) -> Floats:
        """∇d, (n, 3)."""
        return self._function.gradient(points)

    def hessian(self, points: Floats) -> Floats:
        """∇²d, (n, 3, 3)."""
        return self._function.hessian(points)
