"""Speed of mrwork beside other libraries: `python study.py kernels`, and the subjects that `--help` lists."""

from __future__ import annotations

from benchmarks.command_line import main

if __name__ == "__main__":
    main()
