"""Scenarios of studies that several tests evaluate."""

import re
import subprocess
from pathlib import Path

from field_scenario import IN_AIR, swap
from scenarios import MODIFIED

EXAMPLES = Path(__file__).parents[1] / "examples"
S04, H03 = EXAMPLES / "s04.toml", EXAMPLES / "h03.toml"
# Three spacecraft with sensors too narrow for their tips: some pairs never lock.
NARROW = """\
closeform = 1
title = "Narrow"
[orbit]
deep_space = true
[craft]
name = ["P", "Q", "R"]
group = ["A", "B", "A"]
position = ["0 0 0 m", "0 0 0 m", "10 0 0 m"]
velocity = "0 0 0 m/s"
[sensor]
half_angle = "20 deg"
offset = "1 m"
range = "900 m"
[search]
method = "basic"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"
[[stage]]
do = "lock"
[study]
cases = 300
seed = 7
sampled = ["60 s"]
[study.vary]
"craft.velocity" = { normal = "5 cm/s" }
"craft.position" = { shell = ["50 m", "200 m"] }
"""
GATHERING = NARROW.replace('do = "lock"', 'do = "gather"').replace('sampled = ["60 s"]\n', "")


def as_words(command: str) -> list[str]:
    """Return the words of a command as a shell splits them."""
    told = subprocess.run(
        ["sh", "-c", f"printf '%s\\n' {command}"], capture_output=True, text=True, check=True
    )
    return told.stdout.splitlines()


TWICE = """\
closeform = 1
title = "Past a station and back"

[orbit]
altitude = "500 km"

[craft]
name = ["A", "B"]
position = ["0 -200 0 m", "0 0 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "25 m" }
mass = "100 kg"
max_thrust = "1 N"
covariance = [{ position = "1 2 1 m", velocity = "1 1 1 mm/s" }, { position = "1 1 1 m" }]
execution = [{ magnitude = "1 %", pointing = "0.5 deg" }, "exact"]

[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 200 0 m", velocity = "0 0 0 m/s" }
within = "0.3 orbits"
cost = "delta-v"

[[stage]]
do = "coast"
for = "1 min"

[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 -200 0 m", velocity = "0 0 0 m/s" }
within = "0.4 orbits"

[study]
cases = 6
seed = 3
draws = "replanned"

[study.vary]
"craft.mass" = { uniform = "20 kg" }
"""
NEAR = TWICE.replace(
    'draws = "replanned"\n\n[study.vary]\n"craft.mass" = { uniform = "20 kg" }', 'draws = "errors"'
)
STATION = re.sub(r"(covariance|execution|draws) = .*\n", "", TWICE).replace(
    "[study.vary]\n",
    '[study.vary]\n"craft.fails" = { chance = 0.5 }\n"craft.velocity" = { ball = "1 cm/s" }\n',
)
FAILS = STATION.replace(
    'do = "coast"\nfor = "1 min"\n',
    'do = "transfer"\ncraft = "B"\nwithin = "0.1 orbits"\n'
    'to = { position = "0 0 5 m", velocity = "0 0 0 m/s" }\n',
)
ERRORS = '\n[navigation]\nposition = "10 cm"\nvelocity = "0.3 mm/s"\n'
FLIGHT = "\n[simulation]\nseeds = {seeds}\n"
COAST = '\n[[stage]]\ndo = "coast"\nfor = "10 min"\n'
STUDY = """
[study]
cases = 20
seed = 7

[study.vary]
"craft.position" = { normal = "1 m" }
"craft.ballistic" = { uniform = "0.005 m^2/kg" }
"orbit.field.density" = { uniform = "4e-13 kg/m^3" }
"navigation.position" = { uniform = "5 cm" }
"feedback.delay" = { choice = ["0 s", "20 s"] }
"""
MANY = swap(
    **IN_AIR,
    craft='ballistic = ["0.02 m^2/kg", "0.022 m^2/kg"]\nthrust_error = "1 %, 1 deg"',
    more=COAST + ERRORS + '\n[feedback]\nevery = "60 s"\n' + FLIGHT.format(seeds=100) + STUDY,
)
PASS = """\
closeform = 1
title = "Past a station that is not where it should be"

[orbit]
altitude = "500 km"

[craft]
name = ["A", "B", "C"]
position = ["0 -200 0 m", "0 0 0 m", "10 400 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "25 m" }
mass = "100 kg"
max_thrust = "1 N"

[[stage]]
do = "coast"
for = "2 min"

[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 200 0 m", velocity = "0 0 0 m/s" }
within = "0.3 orbits"

[study]
cases = 24
seed = 11

[study.vary]
"craft.position" = { normal = "8 m" }
"craft.velocity" = { ball = "5 mm/s" }
"craft.mass" = { uniform = "20 kg" }
"""
LOST = """\
closeform = 1
title = "Six with short range"

[orbit]
deep_space = true

[craft]
name = ["P", "Q", "R", "S", "T", "U"]
group = ["A", "B", "A", "B", "A", "B"]
position = ["0 0 0 m", "10 0 0 m", "20 0 0 m", "30 0 0 m", "40 0 0 m", "50 0 0 m"]
velocity = "0 0 0 m/s"

[sensor]
half_angle = "70 deg"
offset = "7.5 m"
range = "180 m"

[search]
method = "basic"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"
max_speed = "30 cm/s"

[[stage]]
do = "gather"
rounds = 2

[study]
cases = 24
seed = 5

[study.vary]
"craft.position" = { ball = "250 m" }
"craft.velocity" = { ball = "6 cm/s" }
"""
# Lost spacecraft with little propellant and a small budget.
LIMITED = (
    """\
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

[[stage]]
do = "gather"

[study]
cases = 120
seed = 3

[study.vary]
"craft.position" = { ball = "60 m" }
"craft.velocity" = { ball = "6 cm/s" }
"""
    + MODIFIED
)
