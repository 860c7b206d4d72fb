"""Made-up tables lie with the tests of what reads them."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "analyse"))
