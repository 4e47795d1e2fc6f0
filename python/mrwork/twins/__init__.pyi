from .models import power as power
from .own_stepping import simulate as simulate
