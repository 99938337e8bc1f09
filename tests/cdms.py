"""Conjunction data messages for tests, made of published figures.

`SLOW`, `MEDIUM`: cases 1 (geostationary, e = 0.012) and 8 (medium orbit, e = 0.001) of S. Alfano, Satellite
conjunction Monte Carlo analysis, AAS 09-233 (2009), as NASA's CARA turned its covariances to each object's
own axes (github nasa/CARA_Analysis_Tools).  `FAST`: a real message in
Earth-fixed axes, ION SCV-008 and STARLINK-1233, 5 July 2023 (in the tests of Orekit, github CS-SI/Orekit).
Figures only; the words are our own.
"""

PARTS = ("R", "T", "N", "RDOT", "TDOT", "NDOT")
KEYS = [f"C{PARTS[row]}_{PARTS[column]}" for row in range(6) for column in range(row + 1)]
UNITS = ["m**2", "m**2/s", "m**2/s**2"]
HEAD = """\
CCSDS_CDM_VERS = 1.0
CREATION_DATE = {tca}
ORIGINATOR = TEST
MESSAGE_ID = {id}
TCA = {tca}
MISS_DISTANCE = {miss} [m]
RELATIVE_SPEED = {speed} [m/s]
{rest}"""
OBJECT = """\
OBJECT = OBJECT{number}
OBJECT_DESIGNATOR = {designator}
CATALOG_NAME = SATCAT
OBJECT_NAME = {name}
INTERNATIONAL_DESIGNATOR = {international}
EPHEMERIS_NAME = NONE
COVARIANCE_METHOD = CALCULATED
MANEUVERABLE = {manoeuvrable}
REF_FRAME = {frame}
{rest}"""


def message(head, *objects):
    """The text of a message; `objects` have state [km, km/s] and the lower triangle of a covariance."""
    text = HEAD.format(**{"rest": "", **head})
    for number, each in enumerate(objects, 1):
        words = {"rest": "", "international": "UNKNOWN", "manoeuvrable": "N/A", **each}
        text += OBJECT.format(number=number, **words)
        for key, value in zip(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"), each["state"], strict=True):
            text += f"{key} = {value!r} [{'km/s' if 'DOT' in key else 'km'}]\n"
        for key, value in zip(KEYS, each["covariance"], strict=True):
            text += f"{key} = {value!r} [{UNITS[key.count('DOT')]}]\n"
    return text


SLOW_FIRST = {
    "designator": "1001",
    "name": "PRIMARY",
    "frame": "EME2000",
    "state": [153.446765, 41874.155870, 0.0, 3.066874761, -0.011373615, 0.0],
    "covariance": [
        1.988970273925819e01,
        -3.524140813027809e02,
        6.496749385722737e03,
        0.0,
        0.0,
        1.205039522307600e00,
        2.675448519614438e-02,
        -4.943011253984911e-01,
        0.0,
        3.761358714147070e-05,
        -1.027762112958557e-03,
        1.780445954821163e-02,
        0.0,
        -1.349905611451490e-06,
        5.376164545080801e-08,
        0.0,
        0.0,
        -6.070876344492500e-05,
        0.0,
        0.0,
        3.390390010767800e-09,
    ],
}
# The same, along inertial axes, as published [m^2, m^2/s, m^2/s^2].
SLOW_INERTIAL = [
    [6494.0796232671, -376.13858334524, 0.0, 0.015989484167213, -0.49426167732977, 0.0],
    [-376.13858334524, 22.559465194894, 0.0, -0.00098831404423753, 0.028569460577143, 0.0],
    [0.0, 0.0, 1.2050395223076, 0.0, 0.0, -6.0708763444925e-05],
    [0.015989484167213, -0.00098831404423753, 0.0, 4.4372750192502e-08, -1.2122341939459e-06, 0.0],
    [-0.49426167732977, 0.028569460577143, 0.0, -1.2122341939459e-06, 3.7622976036729e-05, 0.0],
    [0.0, 0.0, -6.0708763444925e-05, 0.0, 0.0, 3.3903900107678e-09],
]
SLOW_SECOND = {
    "designator": "1002",
    "name": "SECONDARY",
    "frame": "EME2000",
    "state": [153.447264, 41874.156370, 0.005000, 3.066864761, -0.011363615, -0.000000001],
    "covariance": [
        1.989074842319444e01,
        -3.524310089952797e02,
        6.496894829253188e03,
        -9.767348673026151e-21,
        6.463165376425425e-19,
        1.204674647143796e00,
        2.675573872452930e-02,
        -4.943115446971844e-01,
        -1.054655281005110e-22,
        3.761433292802947e-05,
        -1.027907518900499e-03,
        1.780719276302711e-02,
        2.016252743098005e-24,
        -1.350111723313400e-06,
        5.377343757879955e-08,
        -6.046657966019955e-23,
        6.318580118652501e-22,
        -6.071534561359923e-05,
        -8.386681333817634e-27,
        2.258381275085438e-27,
        3.392080345234430e-09,
    ],
}
SLOW_HEAD = {
    "id": "A09_1",
    "tca": "2000-01-01T00:00:00.000",
    "miss": 5.049717,
    "speed": 0.014142377,
    "rest": "COMMENT HBR = 15.0\n",
}
SLOW = message(SLOW_HEAD, SLOW_FIRST, SLOW_SECOND)
MEDIUM_FIRST = {
    "designator": "1001",
    "name": "PRIMARY",
    "frame": "EME2000",
    "state": [14971.649317, -20270.398212, 4076.385114, 1.012256512, 1.46081147, 3.527393801],
    "covariance": [
        2.730011483545464,
        -77.98527087944655,
        2665.962873957034,
        -6.338020386298382e-13,
        -7.062822549031012e-12,
        0.4153963500401933,
        0.0123690957702804,
        -0.4231359693614241,
        -2.164934898019055e-15,
        6.71604006409586e-05,
        -0.0002571249003192227,
        0.006349450656572673,
        -7.650130529057719e-16,
        -1.006380241812109e-06,
        2.647996559553895e-08,
        3.662067538115162e-17,
        8.139144884122492e-15,
        -4.462582933106138e-06,
        -9.668380419587341e-19,
        1.012633213417709e-19,
        1.010877072761882e-09,
    ],
}
MEDIUM_SECOND = {
    "designator": "1002",
    "name": "SECONDARY",
    "frame": "EME2000",
    "state": [14971.649363, -20270.399371, 4076.387829, 1.012257401, 1.460811597, 3.52739384],
    "covariance": [
        2.729944919062438,
        -77.98412102927176,
        2665.964447851581,
        -6.731837309814637e-12,
        1.225114454328491e-11,
        0.4153969295672138,
        0.01236891188305445,
        -0.4231361477847755,
        -2.664535259100376e-15,
        6.71604175982068e-05,
        -0.000257119336737169,
        0.006349347939254263,
        -3.018418848199644e-16,
        -1.00636388178019e-06,
        2.647950745124417e-08,
        6.566873857099588e-16,
        2.509339341405601e-15,
        -4.462006508683164e-06,
        -1.248075816908863e-18,
        3.626323099292791e-19,
        1.010863277947521e-09,
    ],
}
MEDIUM_HEAD = {
    "id": "A09_8",
    "tca": "2000-01-01T00:00:00.000",
    "miss": 2.952799,
    "speed": 0.000898467,
    "rest": "COMMENT HBR = 4.0\n",
}
MEDIUM = message(MEDIUM_HEAD, MEDIUM_FIRST, MEDIUM_SECOND)
FAST_HEAD = {
    "id": "000055051_conj_000045214_2023186203115_18614093864417",
    "tca": "2023-07-05T20:31:15.893",
    "miss": 55,
    "speed": 14544,
    "rest": """\
RELATIVE_POSITION_R =-21.3 [m]
RELATIVE_POSITION_T =-15.2 [m]
RELATIVE_POSITION_N =-49.3 [m]
RELATIVE_VELOCITY_R =1.9 [m/s]
RELATIVE_VELOCITY_T =-13954.8 [m/s]
RELATIVE_VELOCITY_N =4100.4 [m/s]
COLLISION_PROBABILITY =0.004450713
COLLISION_PROBABILITY_METHOD =FOSTER-1992
COMMENT Screening Option = Covariance
""",
}
FAST_FIRST = {
    "designator": "55051",
    "name": "ION SCV-008",
    "international": "2023-001AU",
    "frame": "ITRF",
    "rest": "COMMENT Exclusion Volume Radius = 5.000000 [m]\nWEIGHTED_RMS = NaN\n",
    "state": [-5719.153201, -2486.155271, -3021.252701, 2.333174842, 2.825732323, -6.727808538],
    "covariance": [
        127.5401258877026,
        -216.5469301895778,
        9738.762752029239,
        23.41184551274494,
        -5.346171445289681,
        24.60870138594973,
        0.2482739312599897,
        -10.55496325674788,
        0.005950144116086071,
        0.01147849769311488,
        -0.1375882369099475,
        0.1222189661319367,
        -0.02576925085939057,
        -0.0001458466399925159,
        0.0001499094267380701,
        0.008141795305978281,
        -0.05578838789977865,
        -0.0003344474012710994,
        0.00005801069817622688,
        -0.000008757429553163563,
        0.00009287778622823746,
    ],
}
FAST_SECOND = {
    "designator": "45214",
    "name": "STARLINK-1233",
    "international": "2020-012AN",
    "manoeuvrable": "YES",
    "frame": "ITRF",
    "rest": "COMMENT Exclusion Volume Radius = 5.000000 [m]\n",
    "state": [-5719.163147, -2486.1092, -3021.22287, -0.41596327, -5.20688041, 5.081948896],
    "covariance": [
        964.6447977021088,
        -29096.52093664356,
        1555885.738355947,
        -610.4622634358643,
        7105.637820746857,
        1325.505208766663,
        31.55505053547703,
        -1687.047343882137,
        -7.503566951636299,
        1.829454352163062,
        -0.7822616662183071,
        16.88006830847172,
        0.627700053500938,
        -0.01829894383644205,
        0.000706074549697974,
        0.004835998593925756,
        -0.1102870161755583,
        -0.2277988353274012,
        0.00005700360443949522,
        -0.00001234324761245689,
        0.0003799085974184537,
    ],
}
FAST = message(FAST_HEAD, FAST_FIRST, FAST_SECOND)
