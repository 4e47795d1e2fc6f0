"""Speed of mrwork beside other libraries: `python study.py kernels`, and the subjects that `--help` lists."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from studies.speed.command_line import main

if __name__ == "__main__":
    main()
