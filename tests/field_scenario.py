"""Scenarios with a high-fidelity model."""

SWAP = """\
closeform = 1
title = "Two craft change places in the real field"

[orbit]
epoch = "2026-11-22T12:00:00Z"
field = {{ {field} }}

[orbit.chief]
{chief}

[orbit.chief.elements]
semi_major_axis = "6878 km"
eccentricity = 0.001
inclination = "51.6 deg"
latitude = "40 deg"

[craft]
name = ["A", "B"]
position = ["0 0 120 m", "0 0 -120 m"]
velocity = "0 0 0 m/s"
keep_out = {{ sphere = "30 m" }}
{craft}

[[stage]]
name = "swap"
do = "reconfigure"
to = [
  {{ position = "0 0 -120 m", velocity = "0 0 0 m/s" }},
  {{ position = "0 0 120 m", velocity = "0 0 0 m/s" }},
]
within = "0.4 orbits"
"""
AIR = 'density = "5.2e-13 kg/m^3", at_altitude = "500 km", scale_height = "60 km"'
IN_AIR = {"field": f"zonals = 2, {AIR}", "chief": 'ballistic = "0.02 m^2/kg"'}


def swap(field: str = "zonals = 2", chief: str = "", craft: str = "", more: str = "") -> str:
    """Return a scenario of two spacecraft whose zones touch as planned; disturbances make them conflict."""
    return SWAP.format(field=field, chief=chief, craft=craft) + more
