from ..identification.traced import force as force
from ..identification.traced import misfit as misfit
from ..identification.traced import residuals as residuals
from ..identification.traced_twin import DamperTwin as DamperTwin
from ..identification.traced_twin import twin as twin
from ..tuning.traced_score import study_score as study_score
from ..twins.traced_function import TracedFunction as TracedFunction
from ..uncertainty.traced_likelihood import log_likelihood as log_likelihood
