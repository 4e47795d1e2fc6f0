"""What a program keeps on the disk: journals, run folders, codec, fingerprints.

Mechanism only: the files of a type stand beside the type.
"""

from mrwork.store.fingerprint import digest_of
from mrwork.store.journal import Counters, Journal

__all__ = ["Counters", "Journal", "digest_of"]
