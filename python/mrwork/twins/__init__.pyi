from .models import power as power
from .models import simulate as simulate
