"""`python -m mrwork.cli`."""

from mrwork.cli import main

main()
