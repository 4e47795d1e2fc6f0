from .results import TuningResults as TuningResults
from .results import read_tuning as read_tuning
from .run import tune as tune

if True:  # the lower tier
    from .first_candidates import BEST_CONSTANT as BEST_CONSTANT
    from .results import LawResult as LawResult
