"""The journal of a long run: what it has done so far, on the disk, so that it can be killed and go on."""

from mrwork.store.digest import digest_of
from mrwork.store.journal import Counters, Journal

__all__ = ["Counters", "Journal", "digest_of"]
