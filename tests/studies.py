"""Studies of sweeps that several tests share."""


def study_at_temperatures(kind, points, chunk, *, design="", results=""):
    """The text of a study at given surface temperatures, with further lines of its tables."""
    return f"""
[design]
kind = "{kind}"
points = {points}
{design}
[parameters]
slope = {{from = 0.2, to = 0.4}}
e = 0.8
ew = [0.7, 0.8]
roughness = {{from = 0.5, to = 0.8}}
T_surface = {{from = 0.5, to = 50.0, scale = "log"}}
[results]
chunk = {chunk}
{results}
"""
