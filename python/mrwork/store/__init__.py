"""Mechanism of files: journals, run folders, codec, fingerprints.

The file of a type is defined beside the type.
"""

from mrwork.store.codec import digest_of
from mrwork.store.journal import Counters, Journal

__all__ = ["Counters", "Journal", "digest_of"]
