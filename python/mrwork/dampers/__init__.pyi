from . import design as design
from .conversions import OpenSeesBoucWen as OpenSeesBoucWen
from .conversions import bouc_wen_from_normalised as bouc_wen_from_normalised
from .conversions import bouc_wen_from_opensees as bouc_wen_from_opensees
from .conversions import normalised_from_bouc_wen as normalised_from_bouc_wen
from .conversions import opensees_from_bouc_wen as opensees_from_bouc_wen
from .coordinates import Box as Box
from .parameters import CurrentLaws as CurrentLaws
from .spec import DamperSpec as DamperSpec
from .spec import damper as damper
from .spec import damper_models as damper_models

if True:  # the lower tier
    from .parameters import LawName as LawName
    from .spec import PUBLISHED_SETS as PUBLISHED_SETS
