from .models import power as power
from .models import simulate as simulate

if True:  # the lower tier
    from .loop_stepping import stage_values as stage_values
    from .models import twin_of as twin_of
