"""`python -m mrwork`."""

from mrwork.cli import main

main()
