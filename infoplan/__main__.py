"""``python -m infoplan``: the console command."""

import sys

from infoplan.cli import main

if __name__ == "__main__":
    sys.exit(main())
