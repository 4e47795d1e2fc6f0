from .problem import with_tuned_law as with_tuned_law
from .results import TuningResults as TuningResults
from .results import read_tuning as read_tuning
from .run import tune as tune

if True:  # the lower tier
    from .law_tuning import TuningProgress as TuningProgress
    from .results import Front as Front
    from .results import FrontPoint as FrontPoint
    from .results import Judgement as Judgement
    from .results import LawResult as LawResult
    from .space import PENALTY as PENALTY
    from .space import Candidate as Candidate
    from .space import LawCandidate as LawCandidate
    from .space import Objective as Objective
    from .space import SettingSpace as SettingSpace
