from ..runs.study import read_study as read_study
from ..runs.study import study_of as study_of
from .comparison import Comparison as Comparison
from .comparison import compared as compared
from .folder import read_results as read_results
from .fragilities import Fragilities as Fragilities
from .fragilities import Fragility as Fragility
from .fragilities import fragility as fragility
from .results import StudyResults as StudyResults
from .run import run_study as run_study
from .study import Study as Study

if True:  # the lower tier
    from .schema import OPTIMAL_PASSIVE as OPTIMAL_PASSIVE
    from .schema import PASSIVE_OFF as PASSIVE_OFF
    from .schema import PASSIVE_ON as PASSIVE_ON
    from .schema import TuneTable as TuneTable
    from .study import MotionOfStudy as MotionOfStudy
