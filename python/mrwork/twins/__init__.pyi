from ._base import Twin as Twin
from ._base import power as power
from ._base import simulate as simulate
from ._base import twin_of as twin_of
from .loop.run import half_steps as half_steps
