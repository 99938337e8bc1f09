# ruff: noqa: E501 (messages stand as they are printed)
"""The table of bad inputs: what stands in the file, on the command line or in a call, the message, the status.

`tests/test_errors.py` runs every row through the command line, or in Python; `tools/errors_page.py` makes
docs/errors.md of the same rows.
"""

from dataclasses import dataclass

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
F1_F2 = 'position = ["0 0 0 m", "0 100 0 m", "0 200 0 m"]'
SENSOR = """
[sensor]
half_angle = "70 deg"
"""
SEARCH = """
[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"
"""
STUDY = """
[study]
cases = 10
seed = 1
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


@dataclass(frozen=True)
class Bad:
    """A scenario of which one piece is wrong: `new` stands for `old`, or is added where `old` is ""."""

    what: str
    old: str
    new: str
    message: str  # after the file's name
    status: int = 2
    good: str = GOOD

    @property
    def file(self) -> str:
        """Name of the file."""
        return "cluster.toml" if self.good is GOOD else "lost.toml"

    def text(self) -> str:
        """The scenario file."""
        if not self.old:
            return self.good + self.new
        assert self.good.count(self.old) == 1, f"{self.what}: {self.old!r} must stand once in the good file"
        return self.good.replace(self.old, self.new)


def lost(what: str, old: str, new: str, message: str) -> Bad:
    """A search of which one piece is wrong."""
    return Bad(what, old, new, message, good=LOST)


KEEP_OUT = 'keep_out = { sphere = "20 m" }'
ALTITUDE = 'altitude = "500 km"'
FROM_CRAFT = GOOD[GOOD.index("[craft]") :]
FROM_ORBIT = GOOD[GOOD.index(ALTITUDE) :]
FOR = 'for = "5 min"'
TO = 'to = { position = "0 -100 0 m", velocity = "0 0 0 m/s" }'
KNOWN = 'covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }'
SHAKEN = 'execution = { noise = "1e-9 m^2/s^3" }'
VARIED = 'vary = { "craft.velocity" = { ball = "6 cm/s" } }'
SEARCHED = LOST[LOST.index("[sensor]") :]
GAP = '\n\n[[stage]]\ndo = "coast"\nfor = "5 min"'
COAST = 'do = "coast"\nfor = "5 min"'
MOVE = f'name = "pass"\ndo = "avoid"\ncraft = "F3"\n{TO}\nwithin = "0.1 orbits"'
PEARLS = 'do = "reconfigure"\nto = { string_of_pearls = { spacing = "15 m" } }\nwithin = "1 orbit"\n'
TO_TWO = """\
do = "reconfigure"
within = "1 orbit"
to = [
  { position = "0 0 0 m", velocity = "0 0 0 m/s" },
  { position = "0 100 0 m", velocity = "0 0 0 m/s" },
]
"""
CLOSE = TO_TWO.replace("]\n", '  { position = "0 115 0 m", velocity = "0 0 0 m/s" },\n]\n')


def correlated(first: str) -> str:
    """A covariance of which the first two rows of correlations are given."""
    rows = "[0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]"
    return f'covariance = {{ position = "1 2 1 m", correlation = {first}, {rows} }}'


STATES = F1_F2 + '\nvelocity = "0 0 0 m/s"'
NAMES = 'name = ["F1", "F2", "F3"]\n' + STATES
CHIEF = 'epoch = "2026-01-01T00:05:00Z"\nchief = { oem = "a.oem" }'
LOW = 'elements = { altitude = "500 km", inclination = "51.6 deg", latitude = "0 deg" }'
IN_FIELD = 'epoch = "2026-01-01T00:05:00Z"\nchief = { ' + LOW + " }\nfield = { zonals = 2 }"
AIR = 'density = "5.2e-13 kg/m^3", at_altitude = "500 km", scale_height = "60 km"'
FEEDBACK = '\n\n[feedback]\nevery = "60 s"\nhorizon = "10 min"'
A_FIELD = "add field, with epoch and chief, to [orbit], or remove it"
TWO_OEM = 'start = [{ oem = "a.oem" }, { oem = "b.oem" }, { palmer = "0 900 0 0 0 0 m" }]'
AN_EPOCH = (
    'write for example "2026-11-22T12:00:00Z", or another time system behind it, '
    "of GPS, TAI, TCB, TCG, TDB, TT, UTC"
)
WITHOUT_CHIEF = (
    "an inertial state needs the chief's beside it; "
    'add epoch = "2026-11-22T12:00:00Z" and chief = { oem = "chief.oem" } to [orbit]'
)


SCENARIOS = (
    # the file
    Bad(
        "a file that is not TOML",
        'title = "Three craft"',
        "title = Three craft",
        "line 2, column 9: title: not TOML: Invalid value; correct it there",
    ),
    Bad(
        "a key that stands twice",
        'mass = "150 kg"',
        'mass = "150 kg"\nmass = "12 kg"',
        "line 12, column 15: mass: stands twice; keep one",
    ),
    Bad(
        "a table that stands twice",
        "[[stage]]\nname",
        '[craft]\nmass = "1 kg"\n\n[[stage]]\nname',
        "line 19, column 7: [craft]: stands twice; keep one",
    ),
    Bad(
        "a bracket that is not closed",
        '["0 0 0 m", "0 100 0 m", "0 200 0 m"]',
        '["0 0 0 m",\n  "0 100 0 m", "0 200 0 m"',
        "line 11, column 1: position: not TOML: Unclosed array; correct it there",
    ),
    Bad(
        "everything at once",
        GOOD[GOOD.index("[craft]") :],
        """\
[craft]
name = ["F1", "F2", "F2"]
position = ["0 0 0 m", "0 100 0 km/s", "0 200 0 m"]
velocity = "0 0 0 m/s"
mas = "150 kg"
silent = true
max_thrust = "1.5 N"
specific_impulse = "220 s"
propellant = "2 kg"
keep_out = { sphere = "20 m", axis = [0, 1, 0], sigmas = 3 }

[[stage]]
do = "coast"

[[stage]]
do = "hover"
name = "x"

[[stage]]
name = "x"
do = "scatter"
order = ["F1", "F9"]
within = "9e9 orbits"
""",
        """\
craft.keep_out: sigmas goes with covariance only; remove sigmas
craft.keep_out: axis goes with cylinder only; remove axis
craft.mas: unknown key; did you mean mass?
craft.position[2]: "0 100 0 km/s" is a speed, not a length; use m, km, cm, mm
stage[1].for: missing; add for example for = "0.5 orbits"
stage[2].do: "hover" is not known here; use one of coast, transfer, avoid, scatter, regather, reconfigure, lock, gather
stage[3]: order goes with plan = "sequential" only; remove order
stage[3]: needs one of factor, from; add for example factor = 3.0
craft.name: F2 is given 2 times; name each one differently
stage[3].within: must be at most 1e+06 orbits, got 9e+09; give another time""",
    ),
    Bad("no format", "closeform = 1\n", "", "closeform: must say the file's format; write closeform = 1"),
    Bad(
        "a format of the future",
        "closeform = 1",
        "closeform = 2",
        "closeform: must say the file's format; write closeform = 1",
    ),
    Bad(
        "no title",
        'title = "Three craft"\n',
        "",
        'title: must be one line of text; write for example title = "My cluster"',
    ),
    Bad("an unknown table", "", "\n[sensors]\nrange = 2\n", "sensors: unknown key; did you mean sensor?"),
    Bad(
        "a table that is a value",
        f"[orbit]\n{ALTITUDE}",
        'orbit = "500 km"',
        "orbit: is not a table; write it as [orbit]",
    ),
    # keys
    Bad(
        "an unknown key",
        KEEP_OUT,
        'keepout = { sphere = "20 m" }',
        "craft.keepout: unknown key; did you mean keep_out?",
    ),
    Bad(
        "an unknown key inside a table",
        KEEP_OUT,
        'keep_out = { shere = "20 m" }',
        "craft.keep_out.shere: unknown key; did you mean sphere?",
    ),
    Bad(
        "an unknown key without a near one",
        ALTITUDE,
        ALTITUDE + "\nq = 1",
        "orbit.q: unknown key; use one of deep_space, altitude, period, semi_major_axis, mean_motion, latitude, mu, radius, epoch, chief, field",
    ),
    Bad("a missing key", FOR, "", 'stage[1].for: missing; add for example for = "0.5 orbits"'),
    Bad(
        "no velocity",
        'velocity = "0 0 0 m/s"\nmass',
        "mass",
        'craft: no velocity; add for example velocity = "0 0 0 m/s"',
    ),
    Bad(
        "no name",
        'name = ["F1", "F2", "F3"]\n',
        "",
        'craft.name: missing; add for example name = ["F1", "F2"]',
    ),
    Bad(
        "no craft",
        'name = ["F1", "F2", "F3"]',
        "name = []",
        'craft.name: missing; add for example name = ["F1", "F2"]',
    ),
    Bad(
        "no stages",
        f"[[stage]]\n{COAST}\n\n[[stage]]\n{MOVE}",
        "",
        'stage: missing; add [[stage]] with do = "coast" and for = "1 orbit"',
    ),
    # quantities
    Bad(
        "a wrong unit",
        ALTITUDE,
        'altitude = "500 kg"',
        'orbit.altitude: "500 kg" is a mass, not a length; use m, km, cm, mm',
    ),
    Bad(
        "an unknown unit",
        ALTITUDE,
        'altitude = "500 miles"',
        'orbit.altitude: "500 miles" has the unknown unit "miles"; a length takes m, km, cm, mm',
    ),
    Bad(
        "no unit",
        ALTITUDE,
        "altitude = 500",
        'orbit.altitude: 500 has no unit; use m, km, cm, mm, for example "10 m"',
    ),
    Bad(
        "no unit in the text",
        ALTITUDE,
        'altitude = "500"',
        'orbit.altitude: "500" has no unit; use m, km, cm, mm, for example "10 m"',
    ),
    Bad(
        "a vector that is short",
        '"0 100 0 m"',
        '"0 100 m"',
        'craft.position[2]: "0 100 m" is not 3 numbers and one unit; write for example "10 20 30 m"',
    ),
    Bad(
        "a truth value for a quantity",
        'mass = "150 kg"',
        "mass = true",
        'craft.mass: true has no unit; use kg, g, t, for example "10 kg"',
    ),
    Bad(
        "NaN",
        '"0 100 0 m"',
        '"0 nan 0 m"',
        'craft.position[2]: "0 nan 0 m" is not finite; give finite numbers, for example "10 20 30 m"',
    ),
    Bad(
        "infinity",
        ALTITUDE,
        'altitude = "inf km"',
        'orbit.altitude: "inf km" is not finite; give finite numbers, for example "10 m"',
    ),
    Bad(
        "a number too large",
        ALTITUDE,
        'altitude = "1e308 km"',
        'orbit.altitude: "1e308 km" is not finite; give finite numbers, for example "10 m"',
    ),
    Bad(
        "a number out of range",
        ALTITUDE,
        'altitude = "1e200 km"',
        'orbit.altitude: "1e200 km" is out of range; give 1e-30 to 1e+30 in SI units, or 0',
    ),
    Bad(
        "a negative size",
        KEEP_OUT,
        'keep_out = { sphere = "-20 m" }',
        'craft.keep_out.sphere: "-20 m" must be above zero; write for example "10 m"',
    ),
    Bad(
        "a flat box",
        KEEP_OUT,
        'keep_out = { box = "20 0 20 m" }',
        'craft.keep_out.box: "20 0 20 m" must be above zero; write for example "10 20 30 m"',
    ),
    Bad(
        "a duration of zero",
        FOR,
        'for = "0 s"',
        'stage[1].for: "0 s" must be above zero; write for example "10 s"',
    ),
    Bad(
        "a negative duration",
        FOR,
        'for = "-5 min"',
        'stage[1].for: "-5 min" must be above zero; write for example "10 s"',
    ),
    Bad(
        "a drift without a unit",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = 24',
        'stage[2].drift: 24 has no unit; use s, min, h, d, ms, orbits, for example "10 s"',
    ),
    Bad(
        "a drift that is a distance",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "24 m"',
        'stage[2].drift: "24 m" is a length, not a time; use s, min, h, d, ms, orbits',
    ),
    Bad(
        "a drift backwards",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "-24 h"',
        'stage[2].drift: "-24 h" is negative; give zero or more, for example "10 s"',
    ),
    Bad(
        "a drift in words",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "always"',
        'stage[2].drift: "always" is no time; write for example "24 h" or "forever"',
    ),
    Bad(
        "a drift beyond what is flown",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "1e7 orbits"',
        "stage[2].drift: must be at most 1e+06 orbits, got 1e+07; give another time",
    ),
    lost(
        "a drift without an end in deep space",
        'velocity = "0 0 0 cm/s"',
        'velocity = "0 0 0 cm/s"\nkeep_out = { sphere = "1 m" }\n\n[[stage]]\ndo = "coast"\nfor = "9 min"\ndrift = "forever"',
        'stage[1].drift: "forever" needs an orbit; give a time, for example "24 h"',
    ),
    Bad(
        "a failure that nobody knows",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "24 h"\nfailure = "engine"',
        'stage[2].failure: "engine" is not known here; use one of thrust lost, burns missed, thrust weak, thrust stuck',
    ),
    Bad(
        "a failure without a drift",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nfailure = "thrust lost"',
        "stage[2]: failure goes with drift only; remove failure",
    ),
    Bad(
        "thrust that is stuck for no time",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "24 h"\nfailure = "thrust stuck"',
        'stage[2]: failure = "thrust stuck" and longest go together; write for example longest = "10 s"',
    ),
    Bad(
        "a share of thrust that is lost for good",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ndrift = "24 h"\nleast = "90 %"',
        'stage[2]: least goes with failure = "burns missed" or "thrust weak" only; remove least',
    ),
    Bad(
        "a word that is not known",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nmethod = "exakt"',
        'stage[2].method: "exakt" is not known here; did you mean exact?',
    ),
    # craft
    Bad(
        "a list of the wrong length",
        F1_F2,
        'position = ["0 0 0 m", "0 100 0 m"]',
        "craft.position: has 2 values for 3 craft; give one value for all or one each",
    ),
    Bad(
        "duplicate names",
        '["F1", "F2", "F3"]',
        '["F1", "F3", "F3"]',
        "craft.name: F3 is given 2 times; name each one differently",
    ),
    Bad(
        "a name that is not one",
        '["F1", "F2", "F3"]',
        '["F1", " ", "F3"]',
        'craft.name[2]: " " is not a name; use 1 to 24 printable characters without space around them',
    ),
    Bad(
        "two starts at once",
        F1_F2,
        F1_F2 + '\nstart = { palmer = "0 0 0 100 0 0 m" }',
        "craft: start and position with velocity exclude each other; keep one",
    ),
    Bad(
        "thrust without mass",
        'mass = "150 kg"\n',
        "",
        'craft: max_thrust needs mass; add for example mass = "150 kg"',
    ),
    Bad(
        "craft that start inside another's zone",
        '"0 100 0 m"',
        '"0 15 0 m"',
        "craft.position: F1 and F2 start inside each other's zone, at 0.75 x zone; move one of them or make keep_out smaller",
    ),
    Bad(
        "zones of which neither holds the other",
        KEEP_OUT,
        'keep_out = [{ sphere = "20 m" }, { ellipsoid = "10 40 10 m" }, { sphere = "20 m" }]',
        "craft.keep_out: F1 and F2: neither zone holds the other; give both one that holds both",
    ),
    Bad(
        "two shapes for one zone",
        KEEP_OUT,
        'keep_out = { sphere = "20 m", box = "20 40 20 m" }',
        "craft.keep_out: sphere and box exclude each other; keep one",
    ),
    Bad(
        "no shape for a zone",
        KEEP_OUT,
        "keep_out = {}",
        "craft.keep_out: needs one of sphere, box, ellipsoid, covariance, cylinder, half_spaces; "
        'add for example sphere = "20 m"',
    ),
    Bad("no zone", KEEP_OUT, "", 'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }'),
    Bad(
        "a covariance without sigmas",
        KEEP_OUT,
        'keep_out = { covariance = "25 0 100 0 0 25 m^2" }',
        "craft.keep_out: covariance needs sigmas; add for example sigmas = 3.0",
    ),
    Bad(
        "a covariance that is none",
        KEEP_OUT,
        'keep_out = { covariance = "25 0 -100 0 0 25 m^2", sigmas = 3.0 }',
        "craft.keep_out: covariance is not positive definite; check its six numbers: rr tr tt nr nt nn",
    ),
    Bad(
        "covariances of unlike sigmas",
        KEEP_OUT,
        'keep_out = [{ covariance = "25 0 100 0 0 25 m^2", sigmas = 3.0 }, '
        '{ covariance = "25 0 100 0 0 25 m^2", sigmas = 2.0 }, { sphere = "20 m" }]',
        "craft.keep_out: F1 and F2: covariances of 3 and 2 sigmas; demand as many of both",
    ),
    Bad(
        "a covariance as a body",
        KEEP_OUT,
        'keep_out = { kind = "body", covariance = "25 0 100 0 0 25 m^2", sigmas = 3.0 }',
        "craft.keep_out: covariance is of where a craft is, not of its body; remove kind",
    ),
    Bad(
        "a kind of zone that it is not",
        KEEP_OUT,
        'keep_out = { kind = "covariance", sphere = "20 m" }',
        'craft.keep_out: kind = "covariance" goes with covariance only; write "region" or "body"',
    ),
    Bad(
        "bodies that touch at the start",
        KEEP_OUT,
        'keep_out = [{ kind = "body", sphere = "90 m" }, { kind = "body", sphere = "30 m" }, '
        '{ kind = "body", sphere = "30 m" }]',
        "craft.position: F1 and F2 start inside each other's zone, at 0.83 x zone (bodies added); "
        "move one of them or make keep_out smaller",
    ),
    Bad(
        "axes that are not orthonormal",
        KEEP_OUT,
        'keep_out = { box = "20 40 20 m", axes = [[1, 0, 0], [0, 1, 0], [0, 1, 1]] }',
        "craft.keep_out: axes are not orthonormal; give three perpendicular rows of length 1",
    ),
    Bad(
        "a cylinder without its axis",
        KEEP_OUT,
        'keep_out = { cylinder = "10 100 m" }',
        "craft.keep_out: cylinder needs axis; add for example axis = [0, 1, 0]",
    ),
    Bad(
        "a cylinder along nothing",
        KEEP_OUT,
        'keep_out = { cylinder = "10 100 m", axis = [0, 0, 0] }',
        "craft.keep_out: axis is zero; give the cylinder's direction, for example axis = [0, 1, 0]",
    ),
    Bad(
        "more half-spaces than normals",
        KEEP_OUT,
        'keep_out = { half_spaces = "50 20 m", normals = [[1, 0, 0]] }',
        "craft.keep_out: normals: 1 rows for 2 half_spaces; give one for each",
    ),
    Bad(
        "a half-space in no direction",
        KEEP_OUT,
        'keep_out = { half_spaces = "50 m", normals = [[0, 0, 0]] }',
        "craft.keep_out: normals: a row is zero; give the direction out of each face",
    ),
    Bad(
        "half-spaces for craft that are alike",
        KEEP_OUT,
        'keep_out = { half_spaces = "10 m", normals = [[0, 1, 0]] }',
        "craft.keep_out: F1 and F2: neither zone holds the other; give both one that holds both",
    ),
    # errors
    Bad(
        "a covariance that says nothing",
        KEEP_OUT,
        KEEP_OUT + '\ncovariance = { position = "0 0 0 m" }',
        'craft.covariance: says that the state is known exactly; give for example position = "3 6 3 m", or remove it',
    ),
    Bad(
        "a negative standard deviation",
        KEEP_OUT,
        KEEP_OUT + '\ncovariance = { position = "1 -2 1 m" }',
        'craft.covariance.position: "1 -2 1 m" is negative; give zero or more, for example "10 20 30 m"',
    ),
    Bad(
        "a velocity among positions",
        KEEP_OUT,
        KEEP_OUT + '\ncovariance = { position = "1 2 1 m/s" }',
        'craft.covariance.position: "1 2 1 m/s" is a speed, not a length; use m, km, cm, mm',
    ),
    Bad(
        "a correlation that is not symmetric",
        KEEP_OUT,
        f"{KEEP_OUT}\n{correlated('[[1, 0.5, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0]')}",
        "craft.covariance: correlation must be symmetric, got 0.5 at [0, 1] and 0 at [1, 0]; give the same above and below the diagonal",
    ),
    Bad(
        "correlations that no errors have",
        KEEP_OUT,
        f"{KEEP_OUT}\n{correlated('[[1, 1.5, 0, 0, 0, 0], [1.5, 1, 0, 0, 0, 0]')}",
        "craft.covariance: correlation is none, its least eigenvalue is -0.5; none may be below 0; were digits or signs lost?",
    ),
    Bad(
        "sizes among correlations",
        KEEP_OUT,
        f"{KEEP_OUT}\n{correlated('[[9, 0, 0, 0, 0, 0], [0, 4, 0, 0, 0, 0]')}",
        "craft.covariance: correlation has not 1 on its diagonal; the sizes stand in position and velocity",
    ),
    Bad(
        "a share without its unit",
        KEEP_OUT,
        KEEP_OUT + "\nexecution = { magnitude = 0.01 }",
        'craft.execution.magnitude: 0.01 has no unit; use %, ppm, for example "10 %"',
    ),
    Bad(
        "an unknown error of thrust",
        KEEP_OUT,
        KEEP_OUT + '\nexecution = { magnitde = "1 %" }',
        "craft.execution.magnitde: unknown key; did you mean magnitude?",
    ),
    Bad(
        "a hard body without size",
        KEEP_OUT,
        KEEP_OUT + '\nhard_body = "0 m"',
        'craft.hard_body: "0 m" must be above zero; write for example "10 m"',
    ),
    Bad(
        "errors that count twice",
        KEEP_OUT,
        f'keep_out = {{ covariance = "4 0 9 0 0 4 m^2", sigmas = 3 }}\n{KNOWN}',
        "craft: covariance and a keep_out that is one both say where the craft may be; keep one, or give keep_out a size of its own",
    ),
    Bad(
        "sigmas of nothing",
        COAST,
        f"{COAST}\nsigmas = 3",
        'stage[1].sigmas: no craft has errors; add for example covariance = { position = "3 6 3 m", velocity = "2 2 2 mm/s" } to [craft]',
    ),
    Bad(
        "sigmas and a drift of one plan",
        f"{KEEP_OUT}{GAP}\n\n[[stage]]\n{MOVE}",
        f'{KEEP_OUT}\n{KNOWN}{GAP}\n\n[[stage]]\n{MOVE}\nsigmas = 2\ndrift = "24 h"',
        "stage[2]: a plan keeps sigmas or a drift, not both; remove one of them",
    ),
    Bad(
        "no sigmas at all",
        COAST,
        f"{COAST}\nsigmas = 0",
        "stage[1].sigmas: 0 is not above 0.0; write for example sigmas = 3.0",
    ),
    Bad(
        "a probability above one",
        COAST,
        f"{COAST}\nmax_probability = 1.5",
        'stage[1].max_probability: 1.5 is above 1.0; write for example max_probability = 1e-4\ncraft.hard_body: missing; add for example hard_body = "5 m"',
    ),
    Bad(
        "a collision of points",
        KEEP_OUT + GAP,
        f"{KEEP_OUT}\n{KNOWN}{GAP}\nmax_probability = 1e-4",
        'craft.hard_body: missing; add for example hard_body = "5 m"',
    ),
    # orbit
    Bad(
        "two orbits at once",
        ALTITUDE,
        ALTITUDE + '\nperiod = "95 min"',
        "orbit: altitude and period exclude each other; keep one",
    ),
    Bad(
        "no orbit",
        ALTITUDE,
        "",
        'orbit: needs one of altitude, period, semi_major_axis, mean_motion, deep_space, chief; add for example altitude = "500 km"',
    ),
    Bad(
        "a radius without altitude",
        ALTITUDE,
        'period = "95 min"\nradius = "6378 km"',
        "orbit: radius goes with altitude or chief only; remove radius",
    ),
    Bad(
        "orbits in deep space",
        ALTITUDE,
        "deep_space = true",
        'stage[2].within: deep space has no orbits; give a time, for example "30 min"',
    ),
    Bad(
        "a stage that is over before it began",
        FOR,
        'for = "1e-20 s"',
        "stage[1].for: must be at least 1e-12 s, got 1e-20 s; give another time",
    ),
    Bad(
        "orbits without end",
        'within = "0.1 orbits"',
        'within = "1e9 orbits"',
        "stage[2].within: must be at most 1e+06 orbits, got 1e+09; give another time",
    ),
    # stages
    Bad(
        "an unknown verb",
        'do = "avoid"',
        'do = "aviod"',
        'stage[2].do: "aviod" is not known here; did you mean avoid?',
    ),
    Bad("no verb", 'do = "avoid"\n', "", 'stage[2].do: missing; add for example do = "coast"'),
    Bad(
        "a craft that is not there",
        'craft = "F3"',
        'craft = "F33"',
        "stage[2].craft: no craft F33; did you mean F3?",
    ),
    Bad(
        "a craft that moves twice",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nmeanwhile = [{ craft = "F3", to = { palmer = "0 0 0 0 0 0 m" } }]',
        "stage[2]: F3 moves twice in one stage; name each craft once",
    ),
    Bad(
        "duplicate stage names",
        COAST,
        f'name = "pass"\n{COAST}',
        "stage.name: pass is given 2 times; name each one differently",
    ),
    Bad(
        "a stage that is not there",
        COAST,
        'do = "regather"\nas_before = "threat"\nwithin = "1 orbit"',
        "stage[1].as_before: no earlier stage threat; give an earlier stage a name",
    ),
    Bad(
        "a factor that shrinks",
        COAST,
        'do = "scatter"\nfactor = 0.5\nwithin = "1 orbit"',
        "stage[1].factor: 0.5 is not above 1.0; write for example factor = 3.0",
    ),
    Bad(
        "a search without its tables",
        COAST,
        'do = "lock"',
        'sensor: missing; add [sensor] with half_angle = "70 deg"\nsearch: missing; add [search] with method = "modified"\ncraft.group: missing; add for example group = ["A", "B"]\norbit: a search is for deep space only; write deep_space = true instead',
    ),
    # the whole formation
    Bad(
        "final states inside each other's zone",
        COAST,
        CLOSE,
        "stage[1].to: F2 and F3 end inside each other's zone, at 0.75 x zone; move them apart or make keep_out smaller",
    ),
    Bad(
        "slots inside each other's zone",
        COAST,
        PEARLS + "assign = true",
        "stage[1].to: slot 1 and slot 2 end inside each other's zone, at 0.75 x zone; move them apart or make keep_out smaller\n"
        "stage[1].to: slot 2 and slot 3 end inside each other's zone, at 0.75 x zone; move them apart or make keep_out smaller",
    ),
    Bad(
        "fewer slots than craft",
        COAST,
        PEARLS + "assign = true\nslots = 2",
        "stage[1].slots: 2 slots for 3 craft; give at least 3",
    ),
    Bad(
        "fewer final states than craft",
        COAST,
        TO_TWO,
        "stage[1].to: 2 slots for 3 craft; give at least 3",
    ),
    Bad(
        "more final states than craft",
        COAST,
        TO_TWO + 'craft = ["F3"]',
        "stage[1].to: 2 states for 1 craft; give one each, or write assign = true",
    ),
    Bad(
        "slots without a choice",
        COAST,
        PEARLS + "slots = 5",
        "stage[1]: slots goes with assign = true and a named formation only; remove slots",
    ),
    Bad(
        "a phase that is none",
        TO,
        'to = { safety_ellipse = { radial = "90 m", cross_track = "90 m", phase = "dearest" } }',
        'stage[2].to.safety_ellipse.phase: "dearest" is not one number and one unit; write for example "10 deg", or "cheapest"',
    ),
    Bad(
        "the cheapest phase of many",
        COAST,
        'do = "reconfigure"\nto = { projected_circular = { radius = "90 m", first_phase = "cheapest" } }\nwithin = "1 orbit"',
        'stage[1].to: first_phase = "cheapest" is for the one craft of avoid and transfer; give an angle',
    ),
    Bad(
        "an order for a joint plan",
        COAST,
        PEARLS + 'order = ["F1"]',
        'stage[1]: order goes with plan = "sequential" only; remove order',
    ),
    Bad(
        "an order that repeats itself",
        COAST,
        PEARLS + 'plan = "sequential"\norder = ["F1", "F1"]',
        "stage[1].order: F1 stands in it twice; name each craft once",
    ),
    Bad(
        "a formation that is none",
        COAST,
        PEARLS.replace("string_of_pearls", "string_of_perls"),
        "stage[1].to.string_of_perls: unknown key; did you mean string_of_pearls?",
    ),
    Bad(
        "a line in an orbit",
        COAST,
        PEARLS.replace(
            'string_of_pearls = { spacing = "15 m" }', 'line = { spacing = "50 m", direction = [0, 1, 0] }'
        ),
        "stage[1].to: a line is at rest in deep space only; give string_of_pearls or another relative orbit",
    ),
    Bad(
        "a member that joins itself",
        COAST,
        'do = "reconfigure"\ncraft = ["F3"]\nto = { join = ["F1", "F3"] }\nwithin = "1 orbit"',
        "stage[1].to.join: F3 cannot join itself; name the others",
    ),
    Bad(
        "a stage that comes too late",
        COAST,
        'do = "regather"\nas_before = "pass"\nwithin = "1 orbit"',
        "stage[1].as_before: stage pass does not come before this one; name an earlier stage",
    ),
    Bad(
        "a scattering without a measure",
        COAST,
        'do = "scatter"\nwithin = "1 orbit"',
        "stage[1]: needs one of factor, from; add for example factor = 3.0",
    ),
    Bad(
        "a point without a distance",
        COAST,
        'do = "scatter"\nfrom = "0 0 0 m"\nwithin = "1 orbit"',
        'stage[1]: from needs distance; add for example distance = "1 km"',
    ),
    Bad(
        "propellant without specific impulse",
        'mass = "150 kg"',
        'mass = "150 kg"\npropellant = "2 kg"',
        'craft: propellant needs specific_impulse; add for example specific_impulse = "220 s"',
    ),
    Bad(
        "more propellant than craft",
        'mass = "150 kg"',
        'mass = "150 kg"\nspecific_impulse = "220 s"\npropellant = "200 kg"',
        "craft: propellant of 200 kg leaves nothing of a mass of 150 kg; give less of it",
    ),
    # study
    Bad(
        "a key that cannot vary",
        "",
        STUDY + '[study.vary]\n"craft.positon" = { ball = "1 m" }\n',
        'study.vary."craft.positon": cannot vary; did you mean craft.position?',
    ),
    Bad(
        "a key that may be one of two",
        "",
        STUDY + '[study.vary]\n"craft.pointing" = { ball = "1 deg" }\n',
        'study.vary."craft.pointing": cannot vary; did you mean craft.position or craft.pointing_error?',
    ),
    Bad(
        "a key that may vary, without its table",
        "",
        STUDY + '[study.vary]\nposition = { ball = "1 m" }\n',
        "study.vary.position: cannot vary; did you mean craft.position?",
    ),
    Bad(
        "a draw in the wrong unit",
        "",
        STUDY + '[study.vary]\n"craft.position" = { ball = "1 s" }\n',
        'study.vary."craft.position": "1 s" is a time, not a length; use m, km, cm, mm',
    ),
    Bad(
        "a chance for a quantity",
        "",
        STUDY + '[study.vary]\n"craft.mass" = { chance = 0.5 }\n',
        'study.vary."craft.mass": is a mass, chance is for true or false; write { normal = "10 kg" }',
    ),
    Bad(
        "a chance above one",
        "",
        STUDY + '[study.vary]\n"craft.silent" = { chance = 1.5 }\n',
        'study.vary."craft.silent".chance: 1.5 is above 1.0; write for example chance = 0.01',
    ),
    lost(
        "a draw beyond a cone",
        '"craft.velocity" = { ball = "6 cm/s" }',
        '"sensor.half_angle" = { uniform = "80 deg" }',
        'study.vary."sensor.half_angle": some case has -0.174533 in SI units, beyond what sensor.half_angle may be; draw less',
    ),
    lost(
        "a draw of what is not there",
        '"craft.velocity" = { ball = "6 cm/s" }',
        '"sensor.range" = { uniform = "80 m" }',
        'study.vary."sensor.range": there is no sensor.range to add to; give it, or draw a choice',
    ),
    lost(
        "white noise in a search that is planned anew",
        SEARCHED,
        SEARCHED.replace("[sensor]", f"{SHAKEN}\n\n[sensor]").replace(VARIED, 'draws = "replanned"'),
        'study.draws: craft search in stage 1 as they coast, without white noise; remove noise from execution, or write draws = "errors"',
    ),
    lost(
        "a sweep over what is not there",
        'vary = { "craft.velocity" = { ball = "6 cm/s" } }',
        'sweep = { "camera.range" = ["1 km", "2 km"] }',
        "study.sweep: camera.range: there is no camera in the file; add it, or name a key that is there",
    ),
    lost(
        "a sweep that leads too far",
        'vary = { "craft.velocity" = { ball = "6 cm/s" } }',
        'sweep = { "sensor.half_angle" = ["70 deg", "60 deg"] }',
        "study.sweep: with sensor.half_angle = 60 deg: search.sun_limit: a half-angle of 60 deg needs tips of 35.264 deg, the limit is 25 deg; a half-angle of 67.0902 deg would do",
    ),
    lost(
        "a body that is turned around",
        '"craft.velocity" = { ball = "6 cm/s" }',
        '"craft.pointing_error" = { ball = "95 deg" }',
        'study.vary."craft.pointing_error": some body is turned by 90 deg or more; draw less',
    ),
    Bad(
        "a study of nothing",
        "",
        "\n[study]\ncases = 0\nseed = 1\n",
        "study.cases: 0 is below 1; write for example cases = 1000",
    ),
    Bad(
        "a sensor that sees all",
        "",
        SENSOR.replace("70", "180") + SEARCH,
        'sensor: half_angle must be below 180 deg; write for example "70 deg"',
    ),
    Bad(
        "a basic key in a modified search",
        "",
        SENSOR + SEARCH + 'tip_angle = "25 deg"\n',
        'search: tip_angle goes with method = "basic" only; remove tip_angle',
    ),
    Bad(
        "relative elements without a length",
        F1_F2 + '\nvelocity = "0 0 0 m/s"',
        'start = { roe = "0 0 0 4e-5 0 4e-5" }',
        'craft.start.roe: "0 0 0 4e-5 0 4e-5" has no unit; use m, km, cm, mm, for example "10 20 30 40 50 60 m"',
    ),
    Bad(
        "errors to draw of nobody",
        "",
        STUDY + 'draws = "errors"\n',
        'study.draws: no craft has errors; add for example covariance = { position = "3 6 3 m", velocity = "2 2 2 mm/s" } to [craft]',
    ),
    Bad(
        "two kinds of draws",
        KEEP_OUT + GAP,
        f'{KEEP_OUT}\n{KNOWN}\n{STUDY}draws = "errors"\nvary = {{ "craft.position" = {{ ball = "1 m" }} }}{GAP}',
        'study: vary goes with draws = "vary" only; remove vary',
    ),
    Bad(
        "errors to draw and plan anew of nobody",
        "",
        STUDY + 'draws = "replanned"\n',
        'study.draws: no craft has errors; add for example covariance = { position = "3 6 3 m", velocity = "2 2 2 mm/s" } to [craft]',
    ),
    Bad(
        "samples of missions that are planned anew",
        KEEP_OUT + GAP,
        f'{KEEP_OUT}\n{KNOWN}\n{STUDY}draws = "replanned"\nsampled = ["1 s"]{GAP}',
        'study: sampled goes with draws = "vary" only; remove sampled',
    ),
    # not built yet
    Bad(
        "a start from an ephemeris without a chief",
        STATES,
        'start = [{ oem = "a.oem" }, { oem = "b.oem" }, { oem = "b.oem" }]',
        "\n".join(f"craft.start[{k}]: {WITHOUT_CHIEF}" for k in (1, 2, 3)),
    ),
    # epochs and the chief
    Bad(
        "an epoch that is none",
        ALTITUDE,
        ALTITUDE + '\nepoch = "22.11.2026 12:00"',
        f'orbit.epoch: "22.11.2026 12:00" is no epoch; {AN_EPOCH}',
    ),
    Bad(
        "an epoch without quotation marks",
        ALTITUDE,
        ALTITUDE + "\nepoch = 2026-11-22T12:00:00Z",
        'orbit.epoch: "2026-11-22 12:00:00+00:00" is no text; write for example epoch = "2026-11-22T12:00:00Z"',
    ),
    Bad(
        "an epoch in a time system that needs tables",
        ALTITUDE,
        ALTITUDE + '\nepoch = "2026-11-22T12:00:00 UT1"',
        f'orbit.epoch: "2026-11-22T12:00:00 UT1" is no epoch; {AN_EPOCH}',
    ),
    Bad(
        "a leap second that there is not",
        ALTITUDE,
        ALTITUDE + '\nepoch = "2026-06-30T23:59:60Z"',
        f'orbit.epoch: "2026-06-30T23:59:60Z" is no epoch; {AN_EPOCH}',
    ),
    Bad(
        "a key that belongs into a table inside",
        ALTITUDE,
        'epoch = "2026-11-22T12:00:00Z"\nchief = { elements = { inclination = "51 deg", latitude = "0 deg", '
        'altitude = "500 km" }, eccentrcity = 0.01 }',
        "orbit.chief.eccentrcity: unknown key; did you mean elements.eccentricity?",
    ),
    Bad(
        "a chief without an epoch",
        ALTITUDE,
        'chief = { oem = "a.oem" }',
        'orbit: chief needs epoch; add for example epoch = "2026-11-22T12:00:00Z"',
    ),
    Bad(
        "an altitude beside a chief",
        ALTITUDE,
        f"{ALTITUDE}\n{CHIEF}",
        "orbit: altitude and chief exclude each other; keep one",
    ),
    Bad(
        "a chief by two ways",
        ALTITUDE,
        CHIEF.replace("{ ", '{ state = "7000 0 0 km, 0 7.5 0 km/s", '),
        "orbit.chief: state and oem exclude each other; keep one",
    ),
    Bad(
        "a chief whose place on its orbit is not told",
        ALTITUDE,
        CHIEF.replace('oem = "a.oem"', 'elements = { altitude = "550 km", inclination = "97.6 deg" }'),
        'orbit.chief.elements: needs one of latitude, mean_anomaly, true_anomaly; add for example latitude = "10 deg"',
    ),
    Bad(
        "a chief without a comma",
        ALTITUDE,
        CHIEF.replace('oem = "a.oem"', 'state = "7000 0 0 km 0 7.5 0 km/s"'),
        'orbit.chief.state: "7000 0 0 km 0 7.5 0 km/s" is not a position, a comma and a velocity; '
        'write for example "6928 0 0 km, 0 -1 7.5 km/s"',
    ),
    Bad(
        "a chief on no ellipse",
        ALTITUDE,
        CHIEF.replace('oem = "a.oem"', 'state = "7000 0 0 km, 0 75 0 km/s"'),
        "orbit.chief: state: the orbit must be an ellipse (e < 1); check the units, m and m/s",
    ),
    Bad(
        "a chief far from a circle",
        ALTITUDE,
        CHIEF.replace('oem = "a.oem"', 'state = "7000 0 0 km, 0 9 0 km/s"'),
        "orbit.chief: eccentricity 0.422, and Hill's equations, those of a circle, are of use up to 0.1; give another orbit",
    ),
    Bad(
        "a chief in a frame that turns",
        ALTITUDE,
        CHIEF.replace('oem = "a.oem"', 'state = "7000 0 0 km, 0 7.5 0 km/s", frame = "ITRF"'),
        "orbit.chief: frame: 'ITRF' turns or is unknown; convert to one of EME2000, GCRF, ICRF, J2000, MCI, MOD, TEME, TOD",
    ),
    Bad(
        "a chief's file that is not there",
        ALTITUDE,
        CHIEF.replace("a.oem", "none.oem"),
        "orbit.chief: none.oem: no such file or directory; check the path",
    ),
    Bad(
        "a chief's file that is damaged",
        ALTITUDE,
        CHIEF.replace("a.oem", "damaged.oem"),
        "orbit.chief: damaged.oem: line 13: '-o.000754605' is no number; correct the file or ask its originator for it again",
    ),
    Bad(
        "an epoch that a file does not reach",
        ALTITUDE,
        CHIEF.replace("00:05:00", "01:00:00"),
        "orbit.chief: A: has states from 2026-01-01T00:00:00.000000000 to 2026-01-01T00:10:00.000000000 UTC, "
        "and none at 2026-01-01T01:00:00.000000000; give an epoch within them, or a longer file",
    ),
    # field, feedback and navigation
    Bad(
        "a field without a chief",
        ALTITUDE,
        ALTITUDE + "\nfield = { zonals = 2 }",
        "orbit: field needs epoch and chief, whose orbit is in it; add both",
    ),
    Bad(
        "a chief below the ground",
        ALTITUDE,
        IN_FIELD.replace('"500 km"', '"500 km", eccentricity = 0.09'),
        "orbit.chief: comes to -119032 m above a body of 6378136 m; give another orbit",
    ),
    Bad(
        "a field about another body",
        ALTITUDE,
        IN_FIELD.replace(" }\nfield", ', center = "MARS" }\nfield'),
        "orbit.field: is the Earth's, and the chief is about MARS; remove field",
    ),
    Bad(
        "flattening of the first degree",
        ALTITUDE,
        IN_FIELD.replace("zonals = 2", "zonals = 1"),
        "orbit.field.zonals: is 0 or a degree from 2 to 6, not 1; write for example zonals = 2",
    ),
    Bad(
        "air of no density",
        ALTITUDE,
        IN_FIELD.replace("zonals = 2", 'scale_height = "60 km"'),
        'orbit.field: scale_height needs density; add for example density = "5.2e-13 kg/m^3"',
    ),
    Bad(
        "air without ballistic coefficients",
        ALTITUDE,
        IN_FIELD.replace("zonals = 2", AIR),
        'craft.ballistic: missing, in air; add for example ballistic = "0.02 m^2/kg"\n'
        'orbit.chief: needs ballistic in air, like craft; add for example ballistic = "0.02 m^2/kg", "0 m^2/kg" of an orbit that feels none',
    ),
    Bad(
        "a ballistic coefficient without air",
        KEEP_OUT,
        KEEP_OUT + '\nballistic = "0.02 m^2/kg"',
        f"craft.ballistic: there is no air; {A_FIELD}",
    ),
    Bad(
        "errors of thrust without a field",
        KEEP_OUT,
        KEEP_OUT + '\nthrust_error = "1 %, 1 deg"',
        f"craft.thrust_error: is for flights in a field; {A_FIELD}",
    ),
    Bad(
        "a margin for flights without a field",
        TO,
        TO + '\nmargin = "auto"',
        "stage[2].margin: auto is for flights in a field; add field to [orbit], or give a length",
    ),
    Bad(
        "a proof that takes orbits",
        TO,
        TO + '\nprove = "1 orbits"',
        'stage[2]: prove is a time; write for example prove = "10 s"',
    ),
    Bad(
        "a proof of least delta-v",
        TO,
        TO + '\nprove = "10 s"\ncost = "delta-v"',
        'stage[2]: prove goes without cost = "delta-v"; remove one of them',
    ),
    Bad(
        "a proof for a drift",
        TO,
        TO + '\nprove = "10 s"\ndrift = "24 h"',
        "stage[2]: prove goes without drift; remove one of them",
    ),
    Bad(
        "a margin that is no length",
        TO,
        TO + '\nmargin = "wide"',
        'stage[2].margin: "wide" is no length; write for example "0.5 m" or "auto"',
    ),
    Bad(
        "errors of thrust of one kind",
        KEEP_OUT,
        KEEP_OUT + '\nthrust_error = "1 %"',
        'craft.thrust_error: "1 %" is not a share, a comma and an angle; write for example "1 %, 1 deg"',
    ),
    Bad(
        "feedback without a field",
        KEEP_OUT,
        KEEP_OUT + FEEDBACK,
        f"feedback: is for flights in a field; {A_FIELD}",
    ),
    Bad(
        "a study that is to be flown without a field",
        KEEP_OUT,
        f"{KEEP_OUT}\n\n[flight]\n{STUDY}",
        f"flight: is for flights in a field; {A_FIELD}",
    ),
    Bad(
        "flights without number",
        KEEP_OUT,
        f"{KEEP_OUT}\n\n[flight]\nseeds = 0",
        "flight.seeds: 0 is below 1; write for example seeds = 100\n"
        "flight: is for flights in a field; add field, with epoch and chief, to [orbit], or remove it",
    ),
    Bad(
        "two stages that are planned anew in flight",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[flight]\ncontrol = "replan"\n\n[craft]',
        'flight.control: replan is for one stage, and there are 2; write control = "track", or have one stage',
    ),
    Bad(
        "errors of burns where flights have those of thrust",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[flight]\n{STUDY}draws = "errors"\n\n[craft]\ncovariance = {{ position = "1 1 1 m" }}',
        "study.draws: flights draw all errors themselves, in each case anew; remove draws, or [flight]",
    ),
    Bad(
        "a margin for flights with white noise",
        FROM_ORBIT,
        FROM_ORBIT.replace(f"{ALTITUDE}\n\n[craft]", f"{IN_FIELD}\n\n[craft]\n{SHAKEN}")
        + 'margin = "auto"\n',
        'craft.execution: margin = "auto" counts no white noise; remove noise, or give margins in metres',
    ),
    Bad(
        "flights that plan anew what is planned by impulses",
        FROM_ORBIT,
        FROM_ORBIT.replace(ALTITUDE, f'{IN_FIELD}\n\n[flight]\ncontrol = "replan"')
        .replace('[[stage]]\ndo = "coast"\nfor = "5 min"\n\n', "")
        .replace('mass = "150 kg"\nmax_thrust = "1.5 N"\n', "")
        + 'cost = "delta-v"\n',
        'flight.control: replan is for thrust that lasts, and impulses are planned; write control = "track", or have cost = "energy" in the stage',
    ),
    Bad(
        "flights that plan anew, with feedback by impulses",
        FROM_ORBIT,
        FROM_ORBIT.replace(
            ALTITUDE, f'{IN_FIELD}\n\n[flight]\ncontrol = "replan"\n\n[feedback]\nimpulses = 6'
        ).replace('[[stage]]\ndo = "coast"\nfor = "5 min"\n\n', ""),
        'flight.control: replan is for thrust that lasts, and feedback has impulses; write control = "track", or have none in [feedback]',
    ),
    Bad(
        "flights that plan anew, with feedback that comes late",
        FROM_ORBIT,
        FROM_ORBIT.replace(
            ALTITUDE, f'{IN_FIELD}\n\n[flight]\ncontrol = "replan"\n\n[feedback]\ndelay = "5 s"'
        ).replace('[[stage]]\ndo = "coast"\nfor = "5 min"\n\n', ""),
        'flight.control: replan has new plans at once, and feedback has a delay; write control = "track", or have none in [feedback]',
    ),
    Bad(
        "thrust that is lost in flights that plan anew",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[flight]\ncontrol = "replan"\n{STUDY}vary = {{ "craft.fails" = {{ chance = 0.1 }} }}\n\n[craft]',
        'flight.control: replan is for one stage, and there are 2; write control = "track", or have one stage\n'
        'study.vary."craft.fails": new plans would need the thrust that is lost; write control = "track", or remove it',
    ),
    Bad(
        "measurements that some case uses too late",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[flight]{FEEDBACK}\n{STUDY}vary = {{ "feedback.delay" = {{ choice = ["5 s", "90 s"] }} }}\n\n[craft]',
        'study.vary."feedback.delay": delay of 90 s is longer than the 60 s from one measurement to the next; write for example delay = "5 s"',
    ),
    Bad(
        "a draw of navigation that is not there",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[flight]\n{STUDY}vary = {{ "navigation.position" = {{ uniform = "5 cm" }} }}\n\n[craft]',
        'study.vary."navigation.position": there is no [navigation]; add that table or remove the draw',
    ),
    Bad(
        "a horizon shorter than the interval",
        KEEP_OUT,
        KEEP_OUT + FEEDBACK.replace("10 min", "30 s"),
        'feedback: horizon of 30 s is shorter than the 60 s from one measurement to the next; write for example horizon = "10 min"',
    ),
    Bad(
        "thrust that answers after the next measurement",
        KEEP_OUT,
        KEEP_OUT + FEEDBACK.replace('"10 min"', '"10 min"\ndelay = "90 s"'),
        'feedback: delay of 90 s is longer than the 60 s from one measurement to the next; write for example delay = "5 s"',
    ),
    Bad(
        "impulses that answer late",
        KEEP_OUT,
        KEEP_OUT + FEEDBACK.replace('"10 min"', '"10 min"\nimpulses = 6\ndelay = "5 s"'),
        "feedback: delay goes with thrust that lasts; remove delay, or impulses",
    ),
    Bad(
        "navigation worse than the zones",
        f"{ALTITUDE}\n\n[craft]",
        f'{IN_FIELD}\n\n[navigation]\nposition = "12 m"\nvelocity = "20 mm/s"\n\n[craft]',
        "navigation: leaves pairs 27 m off (4 sigmas), and the smallest zone reaches 20 m; give better navigation, another feedback or larger zones",
    ),
    Bad(
        "an inertial state without a chief",
        STATES,
        'start = { inertial = "7000 0 0 km, 0 7.5 0 km/s" }',
        f"craft.start: {WITHOUT_CHIEF}",
    ),
    Bad(
        "states in two inertial frames",
        f'{ALTITUDE}\n\n[craft]\nname = ["F1", "F2", "F3"]\n{STATES}',
        f'{CHIEF}\n\n[craft]\nname = ["F1", "F2", "F3"]\n{TWO_OEM.replace("b.oem", "gcrf.oem")}',
        "craft.start[2]: gcrf.oem: REF_FRAME GCRF differs from EME2000 of the chief; convert one of them",
    ),
    Bad(
        "states too far apart for the epoch between them",
        f'{ALTITUDE}\n\n[craft]\nname = ["F1", "F2", "F3"]\n{STATES}',
        f'{CHIEF}\n\n[craft]\nname = ["F1", "F2", "F3"]\n{TWO_OEM.replace("b.oem", "coarse.oem")}',
        "craft.start[2]: coarse.oem: at the epoch a state between its own may be off by 9.13 m; "
        "give states closer together, or the epoch of one",
    ),
    Bad(
        "a file of states without units",
        STATES,
        'states = "no_units.csv"',
        "craft.states: no_units.csv: column 'x' has no unit; name it one of x_m, x_km, x_cm, x_mm",
    ),
    Bad(
        "a file of states that is not there",
        STATES,
        'states = "none.csv"',
        "craft.states: none.csv: no such file or directory; check the path",
    ),
    Bad(
        "a file of states that lacks a craft",
        NAMES,
        'name = ["F1", "F2", "SERVICER"]\nstates = "states.csv"',
        "craft.states: states.csv: has no row of SERVICER; use one of F1, F2, F3\n"
        "stage[2].craft: no craft F3; use one of F1, F2, SERVICER",
    ),
    Bad(
        "states of another time",
        STATES,
        'states = "later.csv"',
        "\n".join(
            f"craft.states: later.csv: has no row of F{k} at 0 s, when the mission starts; add one"
            for k in (1, 2, 3)
        ),
    ),
    Bad(
        "states of which a number is damaged",
        STATES,
        'states = "damaged.csv"',
        "craft.states: damaged.csv: line 3: '1OO' is no number; correct or remove the row",
    ),
    Bad(
        "states that are cut",
        STATES,
        'states = "cut.csv"',
        "craft.states: cut.csv: line 4: has 4 cells, the columns are 7; correct the row",
    ),
    Bad(
        "states of one craft twice",
        STATES,
        'states = "twice.csv"',
        "craft.states: twice.csv: line 5: a second row of F1; keep one, or add time_s",
    ),
    Bad(
        "states in a file, inertial, without a chief",
        STATES,
        'states = "gcrf.csv"',
        f"craft.states: {WITHOUT_CHIEF}",
    ),
    Bad(
        "states in a file beside positions",
        STATES,
        STATES + '\nstates = "states.csv"',
        "craft: states and position with velocity exclude each other; keep one",
    ),
    Bad(
        "a craft far from the chief",
        f'{ALTITUDE}\n\n[craft]\nname = ["F1", "F2", "F3"]\n{STATES}',
        f'{CHIEF}\n\n[craft]\nname = ["F1", "F2", "F3"]\nstart = {{ inertial = "7000 0 0 m, 0 7.5 0 km/s" }}',
        "craft.start: 6993 km from the chief, where Hill's equations do not hold; check units and frame",
    ),
    # fuel
    Bad(
        "thrusters that are not known",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nthrusters = "six"\nperiod = "30 s"',
        'craft.thrusters: "six" is not known here; use "rtn" or a table with directions',
    ),
    Bad(
        "thrusters whose directions are not unit vectors in a file",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nthrusters = { directions = [[2, 0, 0]] }\nperiod = "30 s"',
        "craft.thrusters: directions[0]: must be of length 1, got 2; give unit vectors, and how strong thrusters are as acceleration",
    ),
    Bad(
        "thrusters of unknown strength",
        'max_thrust = "1.5 N"',
        'thrusters = "rtn"\nperiod = "30 s"',
        'craft: thrusters need max_thrust, which each gives; add for example max_thrust = "10 mN"',
    ),
    Bad(
        "a minimum bit without thrusters",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nminimum_bit = "1 mm/s"',
        "craft: minimum_bit goes with thrusters only; remove minimum_bit",
    ),
    Bad(
        "a minimum bit that is a force",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nthrusters = "rtn"\nperiod = "30 s"\nminimum_bit = "5 mN"',
        'craft.minimum_bit: "5 mN" is a force, not a speed; use m/s, cm/s, mm/s, km/s',
    ),
    Bad(
        "a minimum bit in newton-seconds of a craft without mass",
        'mass = "150 kg"\nmax_thrust = "1.5 N"',
        'max_acceleration = "5 mm/s^2"\nthrusters = "rtn"\nperiod = "30 s"\nminimum_bit = "5 mN s"',
        'craft: minimum_bit in N s needs mass; add for example mass = "12 kg"',
    ),
    Bad(
        "two limits of thrust",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nmax_acceleration = "5 mm/s^2"',
        "craft: max_thrust and max_acceleration exclude each other; keep one",
    ),
    Bad(
        "least energy by thrusters without a period",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nthrusters = "rtn"',
        'craft.period: missing, in which thrusters fire once while a plan of least energy thrusts; add for example period = "30 s", or write cost = "delta-v" in the stage',
    ),
    Bad(
        "two limits of thrust in a stage",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nmax_thrust = "50 mN"\nmax_acceleration = "1 mm/s^2"',
        "stage[2]: max_thrust and max_acceleration exclude each other; keep one",
    ),
    Bad(
        "thrust of a stage as a force, of craft without mass",
        FROM_CRAFT,
        FROM_CRAFT.replace('mass = "150 kg"\nmax_thrust = "1.5 N"\n', "") + 'max_thrust = "50 mN"\n',
        'stage[2].max_thrust: needs mass; add for example mass = "150 kg" to [craft]',
    ),
    Bad(
        "thrusters of a stage of unknown strength",
        FROM_CRAFT,
        FROM_CRAFT.replace('max_thrust = "1.5 N"\n', "") + 'thrusters = "rtn"\nperiod = "30 s"\n',
        'stage[2].thrusters: need max_thrust, which each gives; add for example max_thrust = "10 mN"',
    ),
    Bad(
        "a minimum bit in a stage without thrusters",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nminimum_bit = "1 mN s"',
        "stage[2].minimum_bit: goes with thrusters only; remove minimum_bit",
    ),
    Bad(
        "least energy by thrusters of a stage without a period",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nthrusters = "rtn"',
        'stage[2].period: missing, in which thrusters fire once while a plan of least energy thrusts; add for example period = "30 s", or write cost = "delta-v" in the stage',
    ),
    Bad(
        "a specific impulse of one stage only",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\nspecific_impulse = "60 s"',
        'stage[2].specific_impulse: stands for that of [craft], which has none; add for example specific_impulse = "220 s" there',
    ),
    Bad(
        "two sets of thrusters in one flight",
        FROM_ORBIT,
        FROM_ORBIT.replace(ALTITUDE, f"{IN_FIELD}\n\n[flight]").replace(
            'max_thrust = "1.5 N"', 'max_thrust = "1.5 N"\nthrusters = "rtn"\nperiod = "30 s"'
        )
        + f'\n[[stage]]\n{MOVE.replace("pass", "back")}\nmax_thrust = "50 mN"\n',
        "stage[3].max_thrust: F3 has another in an earlier stage, and flights have one set of thrusters for each craft; give it one, or each set a file of its own",
    ),
    Bad(
        "an unknown cost",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ncost = "fuel"',
        'stage[2].cost: "fuel" is not known here; use one of energy, delta-v',
    ),
    Bad(
        "Sauter and Palmer's method for least delta-v",
        'within = "0.1 orbits"',
        'within = "0.1 orbits"\ncost = "delta-v"\nmethod = "sauter-palmer"',
        'stage[2]: method = "sauter-palmer" goes with cost = "energy" only; remove one of them',
    ),
    Bad(
        "an engine without thrust",
        'max_thrust = "1.5 N"',
        'max_thrust = ["1.5 N", "0 N", "1.5 N"]',
        'craft.max_thrust[2]: "0 N" must be above zero; of a craft without an engine write engine = false',
    ),
    Bad(
        "a move of a craft without an engine",
        KEEP_OUT,
        f"{KEEP_OUT}\nengine = [true, true, false]",
        "stage[2].craft: F3 has no engine; name another craft, or remove engine",
    ),
    Bad(
        "a craft without an engine among all that scatter",
        'keep_out = { sphere = "20 m" }\n\n[[stage]]\ndo = "coast"\nfor = "5 min"',
        'keep_out = { sphere = "20 m" }\nengine = [true, false, true]\n\n[[stage]]\ndo = "scatter"\nfactor = 2.0\nwithin = "1 orbit"',
        "stage[1].do: scatter moves everybody, and F2 has no engine; use reconfigure with craft",
    ),
    Bad(
        "a craft without an engine where nobody is said to move",
        'keep_out = { sphere = "20 m" }\n\n[[stage]]\ndo = "coast"\nfor = "5 min"',
        'keep_out = { sphere = "20 m" }\nengine = [true, false, true]\n\n[[stage]]\ndo = "reconfigure"\nto = { remove = "eccentricity" }\nwithin = "1 orbit"',
        'stage[1].craft: missing, and F2 has no engine; name who moves, for example craft = ["F1", "F3"]',
    ),
    Bad(
        "a transfer that does not say of whom",
        'do = "avoid"\ncraft = "F3"',
        'do = "transfer"',
        'stage[2].craft: missing; name who moves, for example "F1"',
    ),
    Bad(
        "least delta-v over more than a hundred orbits",
        'within = "0.1 orbits"',
        'within = "101 orbits"\ncost = "delta-v"',
        "stage[2].within: the least delta-v is found over at most 100 orbits, got 101; coast for the rest",
    ),
    Bad(
        "a minimum bit above all that a plan asks for",
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nthrusters = "rtn"\nperiod = "30 s"\nminimum_bit = "5 m/s"',
        "stage[2]: minimum_bit: F3: 5 m/s is above the 0.756 m/s that the plan asks of a thruster at a time, so nothing would be fired; plan with impulses, or take finer thrusters",
    ),
)

SEARCHES = (
    lost(
        "one craft alone",
        'name = ["L1", "L2", "L3"]\ngroup = ["A", "B", "A"]\nposition = ["0 0 0 m", "100 0 0 m", "0 90 200 m"]',
        'name = "L1"\ngroup = "A"\nposition = "0 0 0 m"',
        "craft.group: nobody is in group B, locks are between A and B; put a craft into B",
    ),
    lost(
        "an empty group",
        '"A", "B", "A"',
        '"B", "B", "B"',
        "craft.group: nobody is in group A, locks are between A and B; put a craft into A",
    ),
    lost(
        "craft at one place",
        '"100 0 0 m"',
        '"0 0 0 m"',
        "craft.position: L1 and L2 are at one place; move one of them",
    ),
    lost(
        "a search in an orbit",
        "deep_space = true",
        'altitude = "500 km"',
        "orbit: a search is for deep space only; write deep_space = true instead",
    ),
    lost(
        "a sensor that sees nothing",
        '"70 deg"',
        '"0 deg"',
        'sensor.half_angle: "0 deg" must be above zero; write for example "10 deg"',
    ),
    lost(
        "a sensor that sees everything",
        '"70 deg"',
        '"180 deg"',
        'sensor: half_angle must be below 180 deg; write for example "70 deg"',
    ),
    lost(
        "tips beyond the sun limit",
        '"70 deg"',
        '"60 deg"',
        "search.sun_limit: a half-angle of 60 deg needs tips of 35.264 deg, the limit is 25 deg; a half-angle of 67.0902 deg would do",
    ),
    lost(
        "craft that do not turn",
        '"0.25 deg/s"',
        '"0 deg/s"',
        'search.slew_rate: "0 deg/s" must be above zero; write for example "0.25 deg/s"',
    ),
    lost(
        "a sun limit beyond a right angle",
        '"25 deg"',
        '"95 deg"',
        'search: sun_limit must be below 90 deg; write for example "25 deg"',
    ),
    lost(
        "a tip above the sun limit",
        'method = "modified"',
        'method = "basic"\ntip_angle = "30 deg"',
        "search.tip_angle: 30 deg is above the sun limit of 25 deg; tip by at most that",
    ),
    lost(
        "a near field without an end",
        'method = "modified"',
        'method = "basic"\ntip_angle = "10 deg"\nmax_speed = "12 cm/s"',
        "search.max_speed: with tips of 10 deg the near field has no end; tip by more, or leave max_speed out",
    ),
    lost(
        "rounds without end",
        "rounds = 2",
        "rounds = 1_000_000",
        "stage[1].rounds: 1000000 is above 1000; write for example rounds = 3",
    ),
    lost(
        "a move of craft that are lost",
        'do = "gather"',
        'do = "scatter"\nfactor = 2.0\nwithin = "1 h"\n\n[[stage]]\ndo = "gather"',
        "stage[1].do: scatter needs craft that were found; put it after the gather\n"
        'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }',
    ),
    lost(
        "a return to where craft were lost",
        'do = "gather"\nrounds = 2',
        'name = "lost"\ndo = "gather"\n\n[[stage]]\ndo = "regather"\nas_before = "lost"\nwithin = "1 h"',
        "stage[2].as_before: the craft were lost when stage lost began; name a stage after the gather\n"
        'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }',
    ),
    lost(
        "a shape that a gathering does not keep clear",
        'velocity = "0 0 0 cm/s"',
        'velocity = "0 0 0 cm/s"\nkeep_out = { cylinder = "5 20 m", axis = [0, 1, 0] }',
        "craft.keep_out: gather in stage[1] keeps clear of a sphere, box, ellipsoid or covariance only; "
        "give one that holds the others",
    ),
    lost(
        "a relative orbit in deep space",
        'do = "gather"\nrounds = 2',
        'do = "gather"\n\n[[stage]]\ndo = "reconfigure"\nto = { remove = "eccentricity" }\nwithin = "1 h"',
        'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }\n'
        "stage[2].to: a relative orbit, but deep space has no orbits; give line",
    ),
    lost(
        "turns that never gain their rate",
        'velocity = "0 0 0 cm/s"',
        'velocity = "0 0 0 cm/s"\nslew_acceleration = "0 deg/s^2"',
        'craft.slew_acceleration: "0 deg/s^2" must be above zero; write for example "0.01 deg/s^2"',
    ),
    lost(
        "a published figure for no phase",
        "seed = 1",
        'seed = 1\npublished = { "first IPS" = "97.33 %" }',
        'study: published has "first IPS", which is no row of the printed table; use "source", "at once", "never" or a phase like "IPS 1"',
    ),
    lost(
        "samples without number",
        "seed = 1",
        'seed = 1\nsampled = ["1 ms"]',
        'study: sampled has a step below 0.01 s; write for example sampled = ["1 s", "60 s"]',
    ),
    lost(
        "samples of a gathering",
        "seed = 1",
        'seed = 1\nsampled = ["1 s"]',
        "study.sampled: samples are for stages that lock only; remove sampled",
    ),
    lost(
        "no rounds",
        "rounds = 2",
        "rounds = 0",
        "stage[1].rounds: 0 is below 1; write for example rounds = 3",
    ),
    lost(
        "a way of the first pair that is not there",
        "rounds = 2",
        'rounds = 2\nburns = "both"',
        'stage[1].burns: "both" is not known here; use one of least, first, second, half',
    ),
    lost(
        "a craft at NaN",
        '"100 0 0 m"',
        '"nan 0 0 m"',
        'craft.position[2]: "nan 0 0 m" is not finite; give finite numbers, for example "10 20 30 m"',
    ),
    lost(
        "a word that is no group",
        '"A", "B", "A"',
        '"A", "B", "C"',
        'craft.group[3]: "C" is not known here; use one of A, B',
    ),
)


@dataclass(frozen=True)
class Misuse:
    """A command line that cannot be obeyed, in a folder with the files of `tests/test_errors.py`."""

    what: str
    arguments: str  # as typed after "closeform"
    message: str
    status: int = 2


MISUSES = (
    Misuse(
        "flights of a folder that is not there",
        "fly nowhere",
        "nowhere: no such folder; give the folder that a run left",
    ),
    Misuse(
        "flights of what no run left",
        "fly done",
        "done: was left by an earlier version or another command; run it again, or give another folder",
    ),
    Misuse(
        "flights with navigation of one kind",
        'fly done --navigation "10 cm"',
        '--navigation: "10 cm" is not a length, a comma and a speed; write for example "10 cm, 0.3 mm/s"',
    ),
    Misuse(
        "flights with errors of burns of one kind",
        'fly done --execution "1 %"',
        '--execution: "1 %" is not a share, a comma and an angle; write for example "1 %, 1 deg"',
    ),
    Misuse(
        "flights with errors of thrust without units",
        'fly done --thrust-error "1, 1"',
        '--thrust-error: "1" has no unit; use %, ppm, for example "10 %"',
    ),
    Misuse("no flight at all", "fly done --seeds 0", "--seeds: 0 is below 1; give for example --seeds 100"),
    Misuse(
        "an export of a folder that is not there",
        "export nowhere --to oem",
        "nowhere: no such folder; give the folder that a run left",
    ),
    Misuse(
        "an export of a folder of others",
        "export folder --to oem",
        "folder: holds no finished results; run the scenario first",
    ),
    Misuse(
        "an export of what no run left",
        "export done --to oem",
        "done: was left by an earlier version or another command; run it again, or give another folder",
    ),
    Misuse(
        "an export with a step without unit",
        "export done --to oem --step 5",
        '--step: "5" has no unit; use s, min, h, d, ms, for example "10 s"',
    ),
    Misuse("no such file", "run nowhere.toml", "nowhere.toml: no such file or directory; check the path"),
    Misuse("a folder instead of a file", "run folder", "folder: is a directory; check the path"),
    Misuse("a file that is not text", "run picture.toml", "picture.toml: not UTF-8 text; save it as UTF-8"),
    Misuse(
        "a finished result folder",
        "run good.toml --out done",
        "done: holds finished results; add --overwrite or choose another --out",
    ),
    Misuse(
        "files of others among finished results",
        "run good.toml --out used --overwrite",
        "used: holds what is none of its results: notes.txt; move that away or choose another --out",
    ),
    Misuse(
        "a folder of something else",
        "run good.toml --out folder --overwrite",
        "folder: is not a result folder and not empty; choose another --out",
    ),
    Misuse(
        "a file in the way", "run good.toml --out good.toml", "good.toml: is a file; choose another --out"
    ),
    Misuse(
        "a case without a study",
        "run good.toml --case 3",
        "--case: good.toml has no cases; add a [study] table, or leave the case out",
    ),
    Misuse(
        "a case below zero",
        "run lost.toml --case -1",
        "--case: -1 is negative, cases count from 0; give 0 or more",
    ),
    Misuse(
        "a case beyond the last",
        "run lost.toml --case 100000000",
        "--case: 100000000 is above 99999999, the last case that a study can have; give a lower one",
    ),
    Misuse(
        "a search that only its cases tell apart",
        "run cases.toml",
        "cases.toml: craft.position: L1 and L2 are at one place; add --case K, or use closeform study",
    ),
    Misuse(
        "a study without its table",
        "study good.toml",
        "good.toml: study: missing; add [study] with cases = 1000 and seed = 1",
    ),
    Misuse(
        "a study of no cases",
        "study lost.toml --cases 0",
        "--cases: 0 is out of range; give at least 1 and at most 100000000",
    ),
    Misuse(
        "a seed below zero",
        "study lost.toml --seed -1",
        "--seed: -1 is out of range; give at least 0",
    ),
    Misuse(
        "a draw about an acceleration that is not there",
        "study ramps.toml",
        'ramps.toml: study.vary."craft.slew_acceleration": there is no craft.slew_acceleration to add to; '
        "give it, or draw a choice",
    ),
    Misuse(
        "a draw of flights where nothing is flown",
        "study planned.toml",
        'planned.toml: study.vary."craft.ballistic": is of flights, and cases fly none; add [flight], or remove it',
    ),
    Misuse(
        "a scheduler that does not answer",
        "study lost.toml --scheduler tcp://127.0.0.1:1",
        "--scheduler: tcp://127.0.0.1:1 does not answer within 5 s; start it, or check the address",
    ),
    Misuse(
        "a scheduler by a name alone",
        "study lost.toml --scheduler here",
        "--scheduler: here is no address; write tcp://HOST:PORT, tls://HOST:PORT, or the scheduler's file, *.json",
    ),
    Misuse(
        "a scheduler's file that is not there",
        "study lost.toml --scheduler none.json",
        "--scheduler: none.json: no such file or directory; check the path",
    ),
    Misuse(
        "a scheduler's file that is none",
        "study lost.toml --scheduler lost.json",
        "--scheduler: lost.json: is no file of a Dask scheduler; give that which --scheduler-file names",
    ),
    Misuse(
        "a study over finished results",
        "study lost.toml --out done",
        "done: holds finished results; add --overwrite or choose another --out",
    ),
    Misuse(
        "a study that began where those of earlier versions were",
        "study begun.toml",
        "begun-results: holds an unfinished study, 1 of 3 chunks are whole; give --out begun-results to go on "
        "with it, or --out begun-study to begin anew",
    ),
    Misuse(
        "an example that does not come along",
        "new swp",
        "new: there is no example 'swp'; did you mean swap?",
    ),
    Misuse(
        "a shell that nothing is known of",
        "completion tcsh",
        'closeform: Invalid value "tcsh" for SHELL. Choose from: "bash", "zsh", "fish"; see closeform completion --help',
    ),
    Misuse(
        "a screening over finished results",
        'screen a.oem b.oem --sphere "20 m" --out done',
        "done: holds finished results; add --overwrite or choose another --out",
    ),
    Misuse(
        "an encounter in a folder of something else",
        "encounter a.oem --out folder",
        "folder: is not a result folder and not empty; choose another --out",
    ),
    Misuse("no such results", "view nowhere", "nowhere: no such folder; give the folder that a run left"),
    Misuse("unfinished results", "view folder", "folder: holds no finished results; run the scenario first"),
    Misuse(
        "an unknown command",
        "hover good.toml",
        'closeform: Unknown command "hover". Available commands: run, check, fly, screen, encounter, study, view, new; see closeform --help',
    ),
    Misuse(
        "an unknown option",
        "run good.toml --speed 3",
        "closeform: Unknown option: --speed. Did you mean --case?; see closeform run --help",
    ),
    Misuse(
        "an argument that is missing",
        "run",
        'closeform: Command "run" parameter SCENARIO requires an argument; see closeform run --help',
    ),
    Misuse(
        "an option of the wrong kind",
        "run good.toml --case three",
        'closeform: Invalid value for --case: unable to convert "three" into int; see closeform run --help',
    ),
    Misuse(
        "no zone",
        "screen a.oem b.oem",
        'screen: give one of --sphere, --box, --ellipsoid, --cylinder, --hard-body, --covariance, --zones; for example --sphere "20 m"',
    ),
    Misuse(
        "two zones",
        'screen a.oem b.oem --sphere "20 m" --box "1 1 1 m"',
        'screen: give one of --sphere, --box, --ellipsoid, --cylinder, --hard-body, --covariance, --zones; for example --sphere "20 m"',
    ),
    Misuse(
        "a zone in the wrong unit",
        'screen a.oem b.oem --sphere "20 s"',
        '--sphere: "20 s" is a time, not a length; use m, km, cm, mm',
    ),
    Misuse(
        "a zone of negative size",
        'screen a.oem b.oem --ellipsoid "20 -40 20 m"',
        '--ellipsoid: "20 -40 20 m" must be above zero; write for example "10 20 30 m"',
    ),
    Misuse(
        "a cylinder without its axis",
        'screen a.oem b.oem --cylinder "10 100 m"',
        'screen: --cylinder and --axis go together; for example --axis "0 1 0"',
    ),
    Misuse(
        "an axis that is no direction",
        'screen a.oem b.oem --cylinder "10 100 m" --axis "0 0 0"',
        '--axis: "0 0 0" is not a direction; write for example "0 1 0"',
    ),
    Misuse(
        "a covariance without sigmas",
        'screen a.oem b.oem --covariance "25 0 400 0 0 25 m^2"',
        "screen: --covariance needs --sigmas; for example --sigmas 3",
    ),
    Misuse(
        "a covariance that is none",
        'screen a.oem b.oem --covariance "25 0 -400 0 0 25 m^2" --sigmas 3',
        "--covariance: covariance is not positive definite; check its six numbers: rr tr tt nr nt nn",
    ),
    Misuse(
        "a body of covariance",
        'screen a.oem b.oem --covariance "25 0 400 0 0 25 m^2" --sigmas 3 --body',
        "screen: --covariance is of where a craft is, not of its body; leave --body out",
    ),
    Misuse(
        "sigmas of ephemerides without covariances",
        'screen a.oem b.oem --hard-body "5 m" --sigmas 3',
        "--sigmas: no ephemeris has a covariance; add blocks, or give --covariance",
    ),
    Misuse(
        "no sigmas at all",
        'screen a.oem b.oem --hard-body "5 m" --sigmas 0',
        "--sigmas: must be above zero, got 0; write for example --sigmas 3",
    ),
    Misuse(
        "a hard body of two dimensions",
        'screen a.oem b.oem --hard-body "5 4 m"',
        '--hard-body: "5 4 m" is not one number and one unit; write for example "10 m"',
    ),
    Misuse(
        "one ephemeris only",
        'screen a.oem --sphere "20 m"',
        "screen: needs two ephemerides or more; name another file",
    ),
    Misuse(
        "an ephemeris that is not there",
        'screen a.oem nowhere.oem --sphere "20 m"',
        "nowhere.oem: no such file; check the path",
    ),
    Misuse(
        "an empty ephemeris",
        'screen a.oem empty.oem --sphere "20 m"',
        "empty.oem: empty file; give an OEM in key-value or XML form",
    ),
    Misuse(
        "a damaged ephemeris",
        'screen a.oem damaged.oem --sphere "20 m"',
        "damaged.oem: line 13: '-o.000754605' is no number; correct the file or ask its originator for it again",
    ),
    Misuse(
        "an ephemeris cut short",
        'screen a.oem short.oem --sphere "20 m"',
        "short.oem: has 1 states; at least two are needed",
    ),
    Misuse(
        "the same ephemeris twice",
        'screen a.oem a.oem --sphere "20 m"',
        "A: two ephemerides have this OBJECT_NAME; give each its own",
    ),
    Misuse(
        "ephemerides of different times",
        'screen a.oem later.oem --sphere "20 m"',
        "A, B: fewer than two common epochs; they have no time in common; give files that overlap",
    ),
    Misuse(
        "ephemerides whose epochs lie between each other's",
        'screen a.oem between.oem --sphere "20 m"',
        'A, B: fewer than two common epochs; states between them can be interpolated: allow it with interpolate=1.0 (m), or screen --interpolate "1 m"',
    ),
    Misuse(
        "ephemerides too coarse to interpolate",
        'screen a.oem coarse.oem --sphere "20 m" --interpolate "1 m"',
        "B: interpolated states may be off by 198 m, more than 1 m; give states closer in time, or allow so much",
    ),
    Misuse(
        "an allowed error in the wrong unit",
        'screen a.oem between.oem --sphere "20 m" --interpolate "1 s"',
        '--interpolate: "1 s" is a time, not a length; use m, km, cm, mm',
    ),
    Misuse(
        "a covariance that is indefinite in an ephemeris",
        'screen a.oem indefinite.oem --sphere "20 m"',
        "indefinite.oem: line 25: covariance of 2026-01-01T00:00:00: no covariance, its least eigenvalue, scaled by its diagonal, is -1; none may be below 0; were digits or signs lost?",
    ),
    Misuse(
        "a covariance in an unknown frame",
        'screen a.oem lvlh.oem --sphere "20 m"',
        "lvlh.oem: line 26: COV_REF_FRAME LVLH is not supported; give covariances in one of RTN, RSW, TNW, EME2000",
    ),
    Misuse(
        "a conjunction message that is not there",
        "encounter nowhere.cdm",
        "nowhere.cdm: no such file; check the path",
    ),
    Misuse(
        "an ephemeris as a conjunction message",
        "encounter a.oem",
        "a.oem: line 1: not a CDM, which starts with CCSDS_CDM_VERS; give another file",
    ),
    Misuse(
        "a conjunction message without a radius",
        "encounter no_radius.cdm",
        'no_radius.cdm: tells no hard-body radius; give one: --radius "15 m", say',
    ),
    Misuse(
        "a conjunction message in metres",
        "encounter metres.cdm",
        "metres.cdm: line 18: X in [m], where the standard has [km]; convert it, or correct the unit",
    ),
    Misuse(
        "a conjunction message that lacks a keyword",
        "encounter no_state.cdm",
        "no_state.cdm: keyword Y_DOT is missing in OBJECT1; correct the file or ask its originator for it again",
    ),
    Misuse(
        "a conjunction message whose covariance is indefinite",
        "encounter indefinite.cdm",
        "indefinite.cdm: PRIMARY: covariance: no covariance, its least eigenvalue, scaled by its diagonal, is -0.119; none may be below 0; were digits or signs lost?",
    ),
    Misuse(
        "a conjunction of eccentric orbits",
        "encounter ellipse.cdm",
        "ellipse.cdm: primary: eccentricity 0.308 with states in m and m/s; Hill's equations are those of a circle, and of use here up to 0.1",
    ),
    Misuse(
        "a conjunction in two frames",
        "encounter fixed.cdm",
        "fixed.cdm: objects: are in different frames, ITRF and EME2000; convert the states of one",
    ),
    Misuse(
        "a radius in the wrong unit",
        'encounter slow.cdm --radius "15 s"',
        '--radius: "15 s" is a time, not a length; use m, km, cm, mm',
    ),
    Misuse(
        "a window in the wrong unit",
        'encounter slow.cdm --window "15 m"',
        '--window: "15 m" is a length, not a time; use s, min, h, d, ms',
    ),
    Misuse(
        "a limit that nothing keeps",
        "encounter slow.cdm --limit 0",
        "--limit: a probability above 0, up to 1, got 0; give for example 1e-4",
    ),
    Misuse(
        "a limit that is no probability",
        "encounter slow.cdm --limit 2",
        "--limit: a probability above 0, up to 1, got 2; give for example 1e-4",
    ),
)


PYTHON = """\
import closeform as cf

orbit = cf.Orbit.circular(500e3)
start, end = [0, 200, 0, 0, 0, 0], [40, -150, 60, 0, -0.09, 0.02]
plan = orbit.transfer(start, end, 3000.0)
thrusters = cf.Thrusters.rtn(acceleration=2e-3, minimum_bit=1e-4, period=30.0)
fired = cf.fire(plan, thrusters, mass=12.0, specific_impulse=60.0)
primary = [6.9e6, 0, 0, 0, 7600.0, 0]  # inertial
other = orbit.coast([0, 60, 0, 0, 0, 0], 3000.0)
errors = cf.Errors([[4.0 * (i == j) * (1e-6 if i > 2 else 1) for j in range(6)] for i in range(6)])
chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6878137.0, 0, 0.001, 0, 1, 0])
known = [[100.0 * (i == j) * (0.001 if i > 2 else 1) for j in range(6)] for i in range(6)]
chief = cf.Chief.from_elements("2026-11-22T12:00:00", [cf.EARTH_RADIUS + 500e3, 0, 0, 0, 1.7, 0])
"""


@dataclass(frozen=True)
class Call:
    """A call in Python, after the lines of `PYTHON`, that raises ValueError."""

    what: str
    code: str
    message: str


CALLS = (
    Call(
        "a budget of nothing",
        "cf.most_clearance(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), 0.0)",
        "budget: must be positive and finite, got 0.0",
    ),
    Call(
        "clearance from nobody",
        "cf.most_clearance(plan, (), cf.Sphere(25.0), 1e-4)",
        "obstacles: give at least one path",
    ),
    Call(
        "errors of a formation's obstacles by themselves",
        "cf.most_clearance(orbit.coast([[0, 0, 0, 0, 0, 0], [0, 90, 0, 0, 0, 0]], 3000.0), (), cf.Sphere(25.0), 1e-4, other_errors=errors)",
        "other_errors: of a formation; give them in errors, behind those of its craft",
    ),
    Call(
        "zones without a size",
        "cf.clearance_costs(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), [1.0, 0.0])",
        "factors: expected shape (D,), positive and finite, got [1.0, 0.0]",
    ),
    Call(
        "thrusters whose directions are not unit vectors",
        "cf.Thrusters([[1, 0, 0], [1, 1, 0]])",
        "directions[1]: must be of length 1, got 1.41421; give unit vectors, and how strong thrusters are as acceleration",
    ),
    Call(
        "the same thruster twice",
        "cf.Thrusters([[1, 0, 0], [1, 0, 0]])",
        "directions[1]: the same as directions[0]; give one with the sum of both accelerations",
    ),
    Call(
        "thrusters that cannot push where the plan does",
        "cf.fire(plan, cf.Thrusters(thrusters.directions[:5], acceleration=2e-3, period=30.0))",
        "thrusters: at 7.45443 s the plan pushes where they cannot, along -z of their frame; plan with these thrusters, or add one",
    ),
    Call(
        "thrusters that cannot push where the field asks for it beside the plan",
        "cf.thrust(chief.orbit.transfer([0, 200, 0, 0, 0, 0], [40, -150, 0, 0, -0.09, 0], 3000.0), cf.Field(chief), thrusters=cf.Thrusters(thrusters.directions[:5], acceleration=2e-3, period=30.0))",
        "thrusters: craft 0: at 2992.55 s what corrects the plan for this field pushes where they cannot, along -z of their frame; add one there, or fly without thrusters",
    ),
    Call(
        "room beside thrusters of which none pushes across the track",
        "cf.room(chief.orbit.transfer([0, 200, 0, 0, 0, 0], [40, -150, 0, 0, -0.09, 0], 3000.0), cf.Field(chief), thrusters=cf.Thrusters(thrusters.directions[:4], acceleration=2e-3, period=30.0))",
        "thrusters: craft 0: to some side none pushes, and how far it drifts there is not bounded; add one, or give a margin in metres",
    ),
    Call(
        "thrusters that say only where they push",
        "cf.fire(plan, cf.Thrusters.rtn())",
        "thrusters: have no acceleration to fire with; give it, or use with_force",
    ),
    Call(
        "thrust that lasts, without a period",
        "cf.fire(plan, cf.Thrusters.rtn(acceleration=2e-3))",
        "thrusters: have no period, in which thrust that lasts is fired once; give one",
    ),
    Call(
        "a period above the duration",
        "cf.fire(plan, cf.Thrusters.rtn(acceleration=2e-3, period=4000.0))",
        "period: 4000 s is longer than the plan, which takes 3000 s; give a shorter one",
    ),
    Call(
        "thrusters weaker than the plan",
        "cf.fire(plan, cf.Thrusters.rtn(acceleration=1e-5, period=30.0))",
        "acceleration: at about 2985.08 s the plan asks thruster 0 for 0.0001764 m/s², it gives 1e-05; plan with a max_acceleration or more time",
    ),
    Call(
        "a minimum bit above the whole delta-v",
        "cf.fire(plan, cf.Thrusters.rtn(acceleration=2e-3, minimum_bit=5.0, period=30.0))",
        "minimum_bit: 5 m/s is above the 0.193 m/s that the plan asks of a thruster at a time, so nothing would be fired; plan with impulses, or take finer thrusters",
    ),
    Call(
        "impulses closer than their burns are long",
        "cf.fire(orbit.two_impulse(start, [0, 190, 0, 0, -0.34, 0], 60.0), thrusters)",
        "acceleration: thruster 3 fires from -41.6055 to 41.6055 s, and must begin again at 16.6055 s; give it more, or plan with more time between",
    ),
    Call(
        "a mass without a specific impulse",
        "cf.fire(plan, thrusters, mass=12.0)",
        "specific_impulse: give it with mass, or neither",
    ),
    Call(
        "a mass that is not positive",
        "cf.fire(plan, thrusters, mass=0.0, specific_impulse=60.0)",
        "mass: must be positive, got 0",
    ),
    Call(
        "thrusters in a plan of least energy",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), thrusters=thrusters)",
        "thrusters: go with cost 'delta-v'; ask for that, or leave them out",
    ),
    Call(
        "thrusters and a thrust limit beside theirs",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), cost='delta-v', thrusters=thrusters, max_acceleration=0.1)",
        "max_acceleration: bounds thrust in any direction, which thrusters do not have; leave it out, they have their own",
    ),
    Call(
        "thrusters and a thrust limit beside theirs, of one of several craft",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), names=['A'], cost='delta-v', thrusters=thrusters, max_acceleration=0.1)",
        "max_acceleration: A: bounds thrust in any direction, which thrusters do not have; leave it out, or give inf for craft with thrusters, which have their own",
    ),
    Call(
        "a negative drift",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=-5.0)",
        "drift: seconds after the plan's end, 0 or more, got -5.0",
    ),
    Call(
        "a drift without end",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=float('inf'))",
        "drift: must be finite; plan for a finite one, and ask passively_safe about inf",
    ),
    Call(
        "a drift that nobody knows the obstacle for",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=600.0)",
        "obstacles: obstacle 0 ends at 3000 s, the drift at 3600 s; give it until then, or drift less",
    ),
    Call(
        "a drift for least delta-v that nobody knows the obstacle for",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=9.0, cost='delta-v')",
        "obstacles: obstacle 0 ends at 3000 s, the drift at 3009 s; give it until then, or drift less",
    ),
    Call(
        "a drift for least delta-v and a proof",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=0.0, cost='delta-v', prove=2.0)",
        "prove: goes with cost 'energy'; with 'delta-v' leave it out",
    ),
    Call(
        "a drift with one deviation for each conflict",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), 'sauter-palmer', drift=0.0)",
        "drift: goes with method 'exact', not 'sauter-palmer'",
    ),
    Call(
        "a drift for craft that plan one after another",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), method='sequential', drift=0.0)",
        "drift: goes with method 'joint', not 'sequential'",
    ),
    Call(
        "a drift and a proof",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), drift=0.0, prove=2.0)",
        "prove: goes without drift; leave one of them out",
    ),
    Call(
        "a plan at fewer than no sigmas",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), errors=cf.Errors(), sigmas=-1.0)",
        "sigmas: must be finite and at least 0, got -1",
    ),
    Call(
        "a plan with a number for Errors",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), errors=3.0)",
        "errors: expected Errors, got 3.0",
    ),
    Call(
        "a plan with errors of more obstacles than there are",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), other_errors=[cf.Errors()] * 2)",
        "other_errors: 2 for 1 craft; give one, or one for each",
    ),
    Call(
        "a plan with errors of more craft than there are",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), errors=[cf.Errors()] * 2)",
        "errors: 2 for 1 craft; give one, or one for each",
    ),
    Call(
        "a plan with errors that counts a covariance twice",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Uncertainty([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 3.0), errors=cf.Errors())",
        "zone: an Uncertainty beside errors counts them twice; put its covariance into Errors, and give what craft fill as Body(Sphere(radius))",
    ),
    Call(
        "errors and a proof",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), errors=cf.Errors(), prove=2.0)",
        "prove: goes without errors; leave one of them out",
    ),
    Call(
        "errors and a drift",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3600.0), cf.Sphere(25.0), errors=cf.Errors(), drift=0.0)",
        "drift: goes without errors; leave one of them out",
    ),
    Call(
        "errors of craft that plan one after another",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), method='sequential', errors=cf.Errors())",
        "method: goes without errors; leave one of them out",
    ),
    Call(
        "thrusters of more craft than there are",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), cost='delta-v', thrusters=[thrusters] * 2)",
        "thrusters: 2 sets for 1 craft; give one, or one for each",
    ),
    Call(
        "a plan for thrusters that do not push across the track",
        "cf.reconfigure(orbit, [start], [end], 3000.0, cf.Sphere(9.0), names=['A'], cost='delta-v', thrusters=cf.Thrusters(thrusters.directions[:4]))",
        "thrusters: A: no firing in 3000 s gets there: nothing pushes across the track",
    ),
    Call(
        "a plan for thrusters that push to one side",
        "cf.avoid(plan, orbit.coast([9, 0, 0, 0, 0, 0], 3000.0), cf.Sphere(25.0), cost='delta-v', thrusters=cf.Thrusters(thrusters.directions[::2]))",
        "thrusters: no firing in 3000 s gets there: what it needs lies where none of them pushes, as along -0.577 -0.577 -0.577 of their frame; add one there",
    ),
    Call(
        "a plan that found no path",
        "cf.fire(cf.avoid(plan, orbit.coast(start, 3000.0), cf.Sphere(250.0)), thrusters)",
        "plan: has no path to fly: the path's start is 0.00 x zone from obstacle 0; move it or the time",
    ),
    Call(
        "an encounter on an ellipse",
        "cf.Encounter.of([6.9e6, 0, 0, 0, 8300.0, 0], [6.9e6, 9, 0, 0, 8300.0, 0], known, known)",
        "primary: eccentricity 0.193 with states in m and m/s; Hill's equations are those of a circle, and of use here up to 0.1",
    ),
    Call(
        "an encounter in km",
        "cf.Encounter.of([6900, 0, 0, 0, 7.6, 0], [6900, 0.1, 0, 0, 7.6, 0], known, known)",
        "primary: eccentricity 1.000 with states in m and m/s; Hill's equations are those of a circle, and of use here up to 0.1",
    ),
    Call(
        "states long before closest approach",
        "cf.Encounter.of(primary, [6.9e6, 9e5, 0, -900, 7500.0, 0], known, known)",
        "secondary: 9e+05 m from the primary, and Hill's equations hold to 6.9e+04 m; give states at closest approach",
    ),
    Call(
        "axes of a message that are unknown",
        "cf.Encounter.of(primary, primary, known, known, axes='LVLH')",
        'axes: expected "rtn" or "inertial", got \'LVLH\'',
    ),
    Call(
        "the covariance of the other object upside down",
        "cf.Encounter.of(primary, primary, known, [[-one for one in row] for row in known])",
        "secondary_covariance: no covariance, its least eigenvalue, scaled by its diagonal, is -1; none may be below 0; were digits or signs lost?",
    ),
    Call(
        "one word for names",
        "cf.avoid(plan, other, cf.Sphere(9.0), names='client')",
        "names: expected a sequence, got 'client'",
    ),
    Call(
        "a method of collision probability that is unknown",
        "cf.collision_probability(plan, other, cf.Sphere(9.0), errors, method='foster')",
        "method: expected entries, bound, monte-carlo, short-encounter, got 'foster'",
    ),
    Call(
        "entries into a box",
        "cf.collision_probability(plan, other, cf.Box([9.0, 9.0, 9.0]), errors)",
        'zone: "entries" holds for spheres and ellipsoids; use method="monte-carlo"',
    ),
    Call(
        "a collision probability of what is known exactly",
        "cf.collision_probability(plan, other, cf.Sphere(9.0), cf.Errors())",
        "errors: nothing is uncertain; give what is, or use find_conflicts",
    ),
    Call(
        "errors of two different times",
        "cf.collision_probability(plan, orbit.coast(start, 3000.0, start=60.0), cf.Sphere(9.0), errors)",
        "other: starts at 60 s, path at 0 s; errors are those of the start, so begin both at one time",
    ),
    Call(
        "histories of white noise",
        "cf.collision_probability(plan, other, cf.Sphere(9.0), cf.Errors(noise=1e-9))",
        'errors: "entries" draws errors, white noise has no finite number of them; use method="monte-carlo" or "bound"',
    ),
    Call(
        "white noise that no step resolves",
        "cf.collision_probability(plan, other, cf.Sphere(9.0), cf.Errors(noise=1e7), method='monte-carlo')",
        'errors: noise of 1e+07 m^2/s^3 moves craft too far beside the zone in each of 10000 steps; use method="bound"',
    ),
    Call(
        "a collision probability from a handful of samples",
        "cf.collision_probability(plan, other, cf.Sphere(9.0), errors, samples=10)",
        "samples: expected a whole number from 100 on, got 10",
    ),
    Call(
        "a short encounter that is none",
        "cf.collision_probability(other, other, cf.Sphere(9.0), errors, method='short-encounter')",
        'path, other: are closest at the start, and do not pass each other; use method="entries"',
    ),
    Call(
        "a collision probability of many craft at once",
        "cf.collision_probability(cf.stack([plan, plan]), other, cf.Sphere(9.0), errors)",
        "path, other: of one craft each, got shapes (2,) and (); index them",
    ),
    Call(
        "a drift that ends before the plan does",
        "cf.passively_safe(plan, orbit.coast([9, 0, 0, 0, 0, 0], 9000.0), cf.Sphere(25.0), 2000.0)",
        "until: 2000 s is before the end of path, 3000 s; give that or later",
    ),
    Call(
        "another craft whose path ends before the drift",
        "cf.drift_approach(plan, orbit.coast([9, 0, 0, 0, 0, 0], 4000.0), cf.Sphere(25.0), 9000.0)",
        "other: ends at 4000 s, and flies on while the other fails; carry it on to 9000 s, such as by a coast",
    ),
    Call(
        "a drift without an end in deep space",
        "cf.passively_safe(cf.Orbit(0.0).coast(start, 9.0), cf.Orbit(0.0).coast(end, 9.0), cf.Sphere(2.0), float('inf'))",
        "until: inf needs an orbit; in deep space give a time",
    ),
    Call(
        "a screen of who is not one of a pair",
        "cf.drift_screen(cf.stack([plan, plan]), cf.Sphere(25.0), 9000.0, failing='other')",
        "failing: expected 'either' or 'both', got 'other'",
    ),
    Call(
        "a share of thrust of one and more",
        "cf.WeakThrust(1.0)",
        "least: a share of thrust from 0 on, below 1, got 1",
    ),
    Call(
        "thrust that is stuck on for no time",
        "cf.StuckThrust(0.0)",
        "longest: must be positive and finite, got 0 s",
    ),
    Call(
        "thrust that is stuck on along two axes",
        "cf.StuckThrust(9.0, [0.0, 1e-3])",
        "acceleration: expected three finite numbers in m/s^2, got [0.0, 0.001]",
    ),
    Call(
        "impulses that are stuck on",
        "cf.passively_safe(orbit.two_impulse(start, end, 3000.0), orbit.coast([9, 0, 0, 0, 0, 0], 9000.0), cf.Sphere(25.0), 9000.0, cf.StuckThrust(9.0))",
        "failure: path has impulses, whose thrust is unknown; give an acceleration",
    ),
    Call(
        "a craft that fails by a name of its own",
        "cf.passively_safe(plan, orbit.coast([9, 0, 0, 0, 0, 0], 9000.0), cf.Sphere(25.0), 9000.0, failing='chaser')",
        "failing: expected 'path', 'other', 'either' or 'both', got 'chaser'",
    ),
    Call(
        "a failure that is none",
        "cf.drift_approach(plan, orbit.coast([9, 0, 0, 0, 0, 0], 9000.0), cf.Sphere(25.0), 9000.0, failure='thrust')",
        "failure: expected ThrustLost or MissedBurns or WeakThrust or StuckThrust, got 'thrust'",
    ),
    Call(
        "a covariance that is not symmetric",
        "cf.Errors([[1, 0.5, 0, 0, 0, 0], *[[0] * 6] * 5])",
        "state: must be symmetric, got 0.5 at [0, 1] and 0 at [1, 0]",
    ),
    Call(
        "a covariance with an eigenvalue below 0",
        "cf.Errors([[4, 6, 0, 0, 0, 0], [6, 4, 0, 0, 0, 0], *[[0] * 6] * 4])",
        "state: no covariance, its least eigenvalue, scaled by its diagonal, is -0.5; none may be below 0; were digits or signs lost?",
    ),
    Call(
        "a covariance of positions only",
        "cf.Errors([[4, 0, 0], [0, 4, 0], [0, 0, 4]])",
        "state: expected shape (6, 6), positions before velocities, got (3, 3)",
    ),
    Call(
        "a negative deviation of thrust",
        "cf.Errors(magnitude=-0.01)",
        "magnitude: standard deviations and densities are at least 0, got -0.01",
    ),
    Call(
        "errors of thrust of a path through samples",
        "cf.Errors(magnitude=0.1).covariance(orbit.sampled([0, 600, 1200], [start, end, start]), 300.0)",
        "errors: of thrust or impulses, of a path through samples, whose thrust is not known; give `state` and `noise` only",
    ),
    Call(
        "sigmas below 0",
        "cf.find_conflicts(plan, orbit.coast(start, 900.0), cf.Sphere(9.0), cf.Errors(), sigmas=-3)",
        "sigmas: must be finite and at least 0, got -3",
    ),
    Call(
        "errors that are a covariance",
        "cf.clearance_in_sigmas(plan, orbit.coast(start, 900.0), cf.Sphere(9.0), 4.0)",
        "errors: expected Errors, got 4.0",
    ),
    Call(
        "an Uncertainty beside errors",
        "cf.screen(cf.stack([plan, plan]), cf.Uncertainty([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 3.0), cf.Errors())",
        "zone: an Uncertainty beside errors counts them twice; put its covariance into Errors, and give what craft fill as Body(Sphere(radius))",
    ),
    Call(
        "a span of time that ends before it begins",
        "cf.screen(cf.stack([plan, other]), cf.Sphere(9.0), span=(60.0, 0.0))",
        "span: expected two times in s, the first before the second, got (60.0, 0.0); leave it out for all",
    ),
    Call(
        "a chief below the ground",
        "cf.Field(cf.Chief.from_elements('2026-11-22T12:00:00', [6.3e6, 0, 0.001, 0, 1, 0]))",
        "chief: comes to -84436 m above a body of 6378136 m; give another orbit",
    ),
    Call(
        "a degree of zonals that is not there",
        "cf.Field(chief, zonals=7)",
        "zonals: 0, or a degree from 2 to 6, got 7",
    ),
    Call(
        "drag beside a function",
        "cf.Field(chief, drag=cf.Drag(5e-13, 5e5, 6e4, 0.02, 0.02), acceleration=lambda times, states: states)",
        "acceleration: a function of times and states, in place of zonals and drag",
    ),
    Call(
        "a function of times and states that raises",
        "cf.thrust(plan, cf.Field(chief, acceleration=lambda times, states: 1 / 0))",
        "acceleration: the function raises ZeroDivisionError: division by zero; it is given times (M,) and states (M, 6)",
    ),
    Call(
        "a plan of another orbit than the chief's",
        "cf.thrust(cf.Orbit.circular(800e3).transfer(start, end, 900.0), cf.Field(chief))",
        "field: its chief turns once in 5677.0 s, the plan's orbit in 6052.4 s; plan in chief.orbit, or give the chief of this orbit",
    ),
    Call(
        "a plan of deep space in a field",
        "cf.validity(cf.Orbit(0.0).transfer(start, end, 900.0), cf.Field(chief))",
        "plan: of deep space, where no chief has an orbit; plan in an orbit, such as chief.orbit",
    ),
    Call(
        "ballistic coefficients of fewer craft than fly",
        "cf.thrust(cf.stack([plan, plan, plan]), cf.Field(chief, drag=cf.Drag(5e-13, 5e5, 6e4, [0.02, 0.02], 0.02)))",
        "ballistic: expected one number, or one for each of 3 craft, got shape (2,)",
    ),
    Call(
        "zones of pairs of fewer craft than fly",
        "cf.validity(cf.stack([plan, plan, plan]), cf.Field(chief), cf.PairZones.of([cf.Sphere(9.0)] * 2))",
        "zones: zones of 2 craft for 3 paths",
    ),
    Call(
        "an ellipse that is none",
        "cf.EccentricOrbit(1.1e-3, 1.2)",
        "eccentricity: must be at least 0 and below 1, got 1.2",
    ),
    Call(
        "a bound of delta-v beside an ellipse",
        "cf.delta_v_bound(cf.EccentricOrbit(1.1e-3, 0.02), start, end, 900.0)",
        "orbit: expected Orbit, got EccentricOrbit(mean_motion=0.0011, eccentricity=0.02, anomal",
    ),
    Call(
        "coasts that are asked for beyond rounding",
        "cf.coast(start, cf.Field(chief), 900.0, within=1e-9)",
        "within: must be at least 1e-06 m, got 1e-09",
    ),
    Call(
        "a horizon shorter than the time between measurements",
        "cf.Feedback(every=60.0, horizon=30.0)",
        "horizon: 30 s is shorter than the 60 s between measurements; give a longer one",
    ),
    Call(
        "thrust that answers later than the next measurement",
        "cf.Feedback(every=60.0, delay=61.0)",
        "delay: 0 s to the 60 s between measurements, got 61 s",
    ),
    Call(
        "navigation that is worse than the zones",
        "cf.fit_margin(lambda margin: plan, cf.Field(chief), cf.Sphere(9.0), navigation=cf.Navigation(10.0, 0.01))",
        "navigation: 20.7 m of room are needed for what it leaves, more than a zone of 9 m; measure better, or keep larger zones",
    ),
    Call(
        "what is flown before a plan, of other craft",
        "cf.fit_margin(lambda margin: cf.reconfigure(chief.orbit, [start], [end], 3000.0, cf.Sphere(9.0), margin=margin), cf.Field(chief), cf.Sphere(9.0), before=chief.orbit.coast([start, end], 60.0, -60.0))",
        "before: 2 paths of 1 craft; give one of each",
    ),
    Call(
        "a plan that begins before what is flown before it has ended",
        "cf.fit_margin(lambda margin: cf.reconfigure(chief.orbit, [start], [end], 3000.0, cf.Sphere(9.0), margin=margin), cf.Field(chief), cf.Sphere(9.0), before=chief.orbit.coast([start], 60.0))",
        "before: ends at 60 s, and the plan begins at 0 s; leave off the rest",
    ),
    Call(
        "a margin that no function makes a plan of",
        "cf.fit_margin(0.3, cf.Field(chief), cf.Sphere(9.0))",
        "planned: a function of a margin that makes a plan, got 0.3",
    ),
    Call(
        "thrust that is lost at no time",
        "cf.fly(plan, cf.Field(chief), lost=float('nan'))",
        "lost: a time, or inf of who loses nothing, got nan",
    ),
    Call(
        "thrust that is lost where plans are made anew",
        'cf.fly(plan, cf.Field(chief), "replan", zones=cf.Sphere(9.0), lost=60.0)',
        'lost: new plans would need the thrust that is lost; give control="track"',
    ),
    Call(
        "engines of more craft than fly",
        "cf.fly(plan, cf.Field(chief), engine=[True, False])",
        "engine: True or False, or one for each of 1 craft, got [True, False]",
    ),
    Call(
        "a plan that thrusts for a craft without an engine",
        "cf.fly(plan, cf.Field(chief), engine=False)",
        "engine: craft 0 has none, and its path thrusts; give that of its coast",
    ),
    Call(
        "thrusters of a craft without an engine",
        "cf.room(orbit.coast(start, 3000.0), cf.Field(chief), thrusters=cf.Thrusters.rtn(acceleration=1.0, period=60.0), engine=False)",
        "thrusters: craft 0 has no engine; give None in its place",
    ),
    Call(
        "the room for white noise",
        "cf.room(plan, cf.Field(chief), errors=cf.Errors(noise=1e-9))",
        "errors: a room counts no white noise, which flights draw; leave out `noise`",
    ),
    Call(
        "a least bit of thrust that lasts",
        "cf.room(plan, cf.Field(chief), minimum_bit=1e-3)",
        "minimum_bit: of impulses; give a Feedback by some, or leave it out",
    ),
    Call(
        "a flight that surely stays near its path",
        "cf.tube(orbit, cf.Feedback(), cf.Navigation(0.1, 3e-4)).containment(5400.0, 1.0)",
        "probability: between 0 and 1, got 1; nothing random is bounded",
    ),
    Call(
        "a delay of impulses",
        "cf.Feedback(every=600.0, horizon=2400.0, impulses=4, delay=10.0)",
        "delay: goes with thrust that lasts; leave it out, or give 0 impulses",
    ),
    Call(
        "a margin below zero",
        "cf.avoid(plan, orbit.coast(start, 3000.0), cf.Sphere(9.0), margin=-0.1)",
        "margin: metres, 0 or more, finite and symmetric, got -0.1",
    ),
    Call(
        "margins of fewer craft than fly",
        "cf.reconfigure(orbit, [start, end], [end, start], 3000.0, cf.Sphere(9.0), margin=[0.1, 0.2])",
        "margin: one number [m], a Tube, or shape (2, 2) of all pairs, got [0.1, 0.2]",
    ),
    Call(
        "a tube of other craft than are planned",
        "cf.reconfigure(orbit, [start, end], [end, start], 3000.0, cf.Sphere(9.0), margin=cf.tube(orbit, cf.Feedback(), cf.Navigation(), [1e-6] * 3))",
        "margin: a tube of 3 craft for 2; make it of as many",
    ),
    Call(
        "a limit of thrust for impulses",
        "cf.fly(orbit.two_impulse(start, end, 3000.0), cf.Field(chief), max_acceleration=0.1)",
        "max_acceleration: the plan has impulses, which are beyond any limit; leave it out, or plan burns",
    ),
    Call(
        "one impulse for the way back",
        "cf.Feedback(60.0, 600.0, impulses=1)",
        "impulses: one brings no state to zero; give two or more, or 0",
    ),
    Call(
        "impulses half an orbit apart for the way back",
        "cf.fly(plan, cf.Field(chief), feedback=cf.Feedback(600.0, orbit.period, impulses=2))",
        "feedback: 2 impulses, 2838.49 s apart, cannot steer to all sides; give more of them, or another horizon",
    ),
    Call(
        "new plans in flight around no zones",
        'cf.fly(plan, cf.Field(chief), "replan")',
        "control: new plans are around zones, of thrust that lasts, less the residual, at once; give zones, and leave out impulses, cancel and delay",
    ),
    Call(
        "a limit beside thrusters in flight",
        "cf.fly(plan, cf.Field(chief), thrusters=cf.Thrusters.rtn(acceleration=1.0, period=60.0), max_acceleration=1.0)",
        "thrusters: have limits and bits of their own, and fly in the field; leave out max_acceleration, minimum_bit and cancel",
    ),
    Call(
        "a mass without thrusters that burn it",
        "cf.thrust(plan, cf.Field(chief), mass=100.0)",
        "mass: is of thrusters that burn; give them, too",
    ),
    Call(
        "errors of more craft than there are",
        "cf.clearance_in_sigmas(plan, orbit.coast(start, 900.0), cf.Sphere(9.0), [cf.Errors()] * 2)",
        "errors: 2 for 1 craft; give one, or one for each",
    ),
    Call(
        "a format that nobody has",
        'cf.export(plan, "out", "kml", chief=chief)',
        "to: 'kml' is no format; use one of oem, oem-xml, opm, ocm, aem, cdm, csv, stk, czml, spk",
    ),
    Call(
        "an export without an epoch",
        'cf.export(plan, "out", "oem")',
        "oem: needs an epoch; give chief=cf.Chief(...)",
    ),
    Call(
        "a frame that is another one to CCSDS",
        'cf.export(plan, "out", "oem", chief=chief, frame="LVLH")',
        "frame: LVLH is another frame, or each craft's own, to CCSDS; Hill's frame of the chief is RSW_ROTATING",
    ),
    Call(
        "another inertial frame than the chief's",
        'cf.export(plan, "out", "oem", chief=chief, frame="TEME")',
        "frame: TEME is not that of the chief; use EME2000 or RSW_ROTATING",
    ),
    Call(
        "Hill's frame where only inertial ones are told",
        'cf.export(plan, "out", "spk", chief=chief, frame="hill")',
        "frame: spk holds inertial states; leave the frame out",
    ),
    Call(
        "nodes too coarse",
        'cf.export(plan, "out", "oem", chief=chief, step=900.0)',
        "step: 900 s leaves states between nodes up to 1.4e+02 m off, more than 0.001 m; give less, or leave it out",
    ),
    Call(
        "a step of nothing",
        'cf.export(plan, "out", "oem", chief=chief, step=0.0)',
        "step: must be positive, got 0 s",
    ),
    Call(
        "attitudes of who does not search",
        'cf.export(plan, "out", "aem", chief=chief)',
        "aem: nobody searches, and only searches have attitudes; export an oem",
    ),
    Call(
        "conjunctions of paths",
        'cf.export(plan, "out", "cdm", chief=chief)',
        "cdm: paths have no zones and covariances of their own; export a run",
    ),
    Call(
        "a chief on another orbit",
        'cf.export(plan, "out", "oem", chief=cf.Chief(chief.epoch, 1.01 * chief.state))',
        "chief: has a mean motion of 0.00104120445 rad/s, the paths one of 0.00110678345 rad/s; give the orbit that the paths were planned in",
    ),
    Call(
        "two craft of one name",
        'cf.export(cf.stack([plan, plan]), "out", "oem", chief=chief, names=["A", "A"])',
        "names: expected 2 names, each another, got A, A",
    ),
    Call(
        "axes of deep space without a name",
        'cf.export(cf.Orbit(0.0).coast(start, 60.0), "out", "oem", chief=chief)',
        "frame: in deep space the axes are the scenario's own; name them, as ICRF",
    ),
    Call(
        "deep space on a globe",
        'cf.export(cf.Orbit(0.0).coast(start, 60.0), "out", "czml", chief=chief, frame="ICRF")',
        "czml: holds states about a body, and deep space has none; export an oem",
    ),
    Call(
        "a table that is not there",
        'cf.read_csv("nowhere.csv")',
        "nowhere.csv: cannot be read: No such file or directory; check the path",
    ),
    Call(
        "a plan that has no path, drawn",
        "cf.plot(cf.avoid(plan, orbit.coast(start, 3000.0), cf.Sphere(25.0)))",
        "result: a plan without a path, the path's start is 0.00 x zone from obstacle 0; move it or the time",
    ),
    Call(
        "a picture of what was found, with zones",
        "cf.plot(cf.screen(cf.stack([plan, other]), cf.Sphere(9.0)), zone=cf.Sphere(9.0))",
        "zone: no part of the picture of a Screening; leave it out",
    ),
    Call(
        "an animation that is no GIF",
        'cf.animate(plan, "flight.mp4")',
        "file: animations are GIF, give NAME.gif, got flight.mp4",
    ),
)

# What is taken, with a warning.
WARNED = (
    Call(
        "positions in km beside velocities in m/s",
        "cf.clearance_in_sigmas(plan, other, cf.Sphere(9.0), cf.Errors([[(i == j) * (1e-6 if i > 2 else 2.5e-7) for j in range(6)] for i in range(6)]))",
        "errors: velocities to 0.00173205 m/s beside positions to 0.000866025 m; are units mixed, km with m/s?",
    ),
)
