"""Mechanism of files: journals, run folders, codec, fingerprints.

The file of a type is defined beside the type.
"""

from mrwork.store.journal import Counters, Journal
from mrwork.store.record import digest_of

__all__ = ["Counters", "Journal", "digest_of"]
