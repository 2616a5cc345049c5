"""``python -m warpedfoam.cli``: the ``warpedfoam`` command."""

import sys

from warpedfoam.cli import main

if __name__ == "__main__":
    sys.exit(main())
