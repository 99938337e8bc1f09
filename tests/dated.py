"""Scenarios with an epoch and a chief."""

PLAIN = """\
closeform = 1
title = "Two that meet"

[orbit]
ORBIT

[craft]
name = ["A", "B"]
START
keep_out = { sphere = "20 m" }

[[stage]]
do = "coast"
for = "40 s"

[[stage]]
do = "transfer"
craft = "B"
to = { position = "0 200 0 m", velocity = "0 0 0 m/s" }
within = "5 min"
cost = "delta-v"
"""
MEETING = 'position = ["0 0 0 m", "0 25 0 m"]\nvelocity = ["0 0 0 m/s", "0 -1 0 m/s"]'
CIRCLE = 'semi_major_axis = "7000 km", inclination = "97.6 deg", ascending_node = "30 deg"'


def scenario(orbit='altitude = "550 km"', start=MEETING):
    return PLAIN.replace("ORBIT", orbit).replace("START", start)


def chief(elements, epoch="2026-11-22T12:00:00Z"):
    return f'epoch = "{epoch}"\nchief = {{ elements = {{ {elements} }} }}'
