"""Voronoi foams: SciPy's exact diagram on the sphere, charges, volumes, refinement and clear refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial import SphericalVoronoi
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from warpedfoam import Foam, HeleShawCell, ResolutionError, Sphere, Torus, voronoi_foam
from warpedfoam.tessellate import build
from warpedfoam.tessellate.regions import corner_weights, region_network, tidy_labels
from warpedfoam.tessellate.seeds import SEED_KINDS if False else blue_noise_seeds, random_seeds
