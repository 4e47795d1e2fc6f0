"""Paths of the command line; apart from the other options, which load more than most verbs need."""

from __future__ import annotations

import argparse
from pathlib import Path


def named_path(text: str) -> Path:
    """The path that a text names; an empty one, as of a shell variable that is not set, would be this folder.

    Raises
    ------
    argparse.ArgumentTypeError
        Where the text is empty.
    """
    if not text:
        raise argparse.ArgumentTypeError("the name is empty; give a file or folder, . for this folder")
    return Path(text)
