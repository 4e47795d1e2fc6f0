from .problem import with_tuned_law as with_tuned_law
from .results import Front as Front
from .results import TuningResults as TuningResults
from .results import read_tuning as read_tuning
from .run import tune as tune
