from .powers import power as power
from .stepping import simulate as simulate
