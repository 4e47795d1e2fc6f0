"""Speed of mrwork beside other libraries: `python study.py kernels|models|identify|refine|posterior|loop`."""

from __future__ import annotations

from benchmarks.command_line import main

if __name__ == "__main__":
    main()
