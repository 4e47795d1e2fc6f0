"""Where the measured records are, which stay outside the project, and the mark of tests that use them."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
