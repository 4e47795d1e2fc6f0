from ..identification.traced import TracedFunction as TracedFunction
from ..identification.traced import force as force
from ..identification.traced import misfit as misfit
from ..identification.traced import residuals as residuals
from ..uncertainty.traced_likelihood import log_likelihood as log_likelihood
