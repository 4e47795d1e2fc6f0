"""Study files for tests of what a law is told."""


def study_text(settings: str, *, damper: str = "differential = true") -> str:
    """A study of one clipped-optimal law on the five-storey frame; its settings begin in line 16."""
    return f"""[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
{damper}

[[motion]]
synthetic = "kanai_tajimi"
duration = 2

[[controller]]
law = "clipped_optimal"
[controller.settings]
{settings}
"""


ONE_STOREY = """[building]
n_storeys = 1
masses = ["20 t"]
stiffnesses = ["12 kN/mm"]
height = "3 m"
[[damper]]
storey = 1
preset = "kwok2006"
count = 10
"""
