"""Scenarios for tests: a spacecraft that crosses a cluster, and lost spacecraft that search."""

GOOD = """\
closeform = 1
title = "Three craft"

[orbit]
altitude = "500 km"

[craft]
name = ["F1", "F2", "F3"]
position = ["0 0 0 m", "0 100 0 m", "0 200 0 m"]
velocity = "0 0 0 m/s"
mass = "150 kg"
max_thrust = "1.5 N"
keep_out = { sphere = "20 m" }

[[stage]]
do = "coast"
for = "5 min"

[[stage]]
name = "pass"
do = "avoid"
craft = "F3"
to = { position = "0 -100 0 m", velocity = "0 0 0 m/s" }
within = "0.1 orbits"
"""
MODIFIED = """
[sensor]
half_angle = "70 deg"

[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"
"""
LOST = """\
closeform = 1
title = "Three lost craft"

[orbit]
deep_space = true

[craft]
name = ["L1", "L2", "L3"]
group = ["A", "B", "A"]
position = ["0 0 0 m", "100 0 0 m", "0 90 200 m"]
velocity = "0 0 0 cm/s"

[sensor]
half_angle = "70 deg"
offset = "7.5 m"

[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[[stage]]
do = "gather"
rounds = 2

[study]
cases = 100
seed = 1
vary = { "craft.velocity" = { ball = "6 cm/s" } }
"""
