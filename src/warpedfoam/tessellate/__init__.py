"""From a cell to a foam: seeds, geodesic regions, cell network."""
