""""""

LOST = """\
closeform = 1
title = "Lost"

[orbit]
deep_space = true

[craft]
name = ["L1", "L2", "L3"]
group = ["A", "B", "A"]
position = "0 0 0 m"
velocity = "0 0 0 m/s"
mass = "100 kg"
specific_impulse = "60 s"
propellant = "14 g"
delta_v_budget = "8 cm/s"
keep_out = { sphere = "20 m" }

[sensor]
half_angle = "70 deg"

[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[[stage]]
do = "gather"

[study]
cases = 120
seed = 3

[study.vary]
"craft.position" = { ball = "60 m" }
"craft.velocity" = { ball = "6 cm/s" }
"""
