from .models import power as power
from .models import simulate as simulate

if True:  # the lower tier
    from .loop_stepping import half_steps as half_steps
    from .models import twin_of as twin_of
