from .candidates import CandidateObjective as CandidateObjective
from .candidates import ForceSensitivities as ForceSensitivities
from .equivalent import search_box as search_box
from .fit import Fit as Fit
from .objective import Objective as Objective
from .problem import start_from as start_from
from .settings import FitSettings as FitSettings
from .settings import Race as Race
