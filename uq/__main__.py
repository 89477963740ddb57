"""``python -P -m uq``: the command ``inertia`` where its folder is not on the PATH."""

import sys

from uq.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
