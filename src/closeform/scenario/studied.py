"""Checks of [study] against the other tables: keys that cannot vary and draws out of range."""

from collections.abc import Callable, Iterator
from math import hypot, inf, pi
from operator import attrgetter
from typing import Any

from closeform.scenario.craft import MOST_TURN, Craft
from closeform.scenario.errors import alike, did_you_mean, dotted
from closeform.scenario.scenario import Scenario
from closeform.scenario.study import NORMAL_REACH, SEARCHED, TABLED, Draw, draw_error, readers

WITHIN = {"sensor.half_angle": (0.0, pi), "craft.slew_rate_error": (-1.0, inf)}  # unchecked by readers
NEAR = 3  # number of similar keys to suggest


def study(scenario: Scenario, sound: Callable[[str], bool]) -> Iterator[str]:
    """Yield an error line for each draw for a key that cannot vary, of the wrong kind or out of range.

    `sound` returns True if no key of a pattern has an error; draws for other tables are skipped.
    """
    if scenario.study is None:
        return
    if scenario.study.draws != "vary":
        yield from drawn_errors(scenario)
    if scenario.study.draws == "errors":
        yield from somebody_to_meet(scenario)
    astray = any(craft.astray for craft in scenario.craft) or {*SEARCHED} & {*scenario.study.vary}
    if scenario.study.sampled and astray:
        yield "study.sampled: samples look at searches without errors; remove sampled, or those"
    for key, draw in scenario.study.vary.items():
        place, known = dotted(("study", "vary", key)), readers()
        section = key.rpartition(".")[0]
        if key not in known:
            near = [one for one in known if not one.startswith(TABLED) or there(scenario, one)]
            yield f"{place}: cannot vary; {did_you_mean(key, near, alike(key, near, NEAR))}"
        elif wrong := draw_error(key, draw):
            yield f"{place}: {wrong}"
        elif not (scenario.craft if section == "craft" else sound(f"{section}.*")):
            continue
        elif section != "craft" and not there(scenario, key):
            yield f"{place}: there is no [{section}]; add that table or remove the draw"
        elif wrong := too_far(scenario, key, draw):
            yield f"{place}: {wrong}"


def there(scenario: Scenario, key: str) -> bool:
    """Return True if the file has the table of a key outside [craft]."""
    return attrgetter(key.rpartition(".")[0])(scenario) is not None


def too_far(scenario: Scenario, key: str, draw: Draw) -> str | None:
    """Return the reason why some case of a draw exceeds the range of the key, or None."""
    reader, numbers = readers()[key], draw.numbers(key)
    if reader is None:
        return None
    given = scenario.given(key)
    if key == "craft.pointing_error":
        return too_much_turn(given, draw, numbers)
    if reader.size != 1:
        return None
    if draw.choice is None and None in given:
        return f"there is no {key} to add to; give it, or draw a choice"
    reach = {"choice": 0.0, "normal": NORMAL_REACH}.get(draw.kind, 1.0) * max(numbers)
    ends = numbers if draw.choice is not None else given
    least, most = WITHIN.get(key, (-inf if reader.least == "any" else 0.0, inf))
    low, high = min(ends) - reach, max(ends) + reach
    if (low > least and high < most) or (reader.least == "zero" and low == least):
        return unfit(scenario, key, (low, high)) if key.startswith(TABLED) else None
    worst = high if high >= most else low
    return f"some case has {worst:.6g} in SI units, beyond what {key} may be; draw less"


def unfit(scenario: Scenario, key: str, values: tuple[float, ...]) -> str | None:
    """Return the first flaw of a key's table with one of these values, or None."""
    section, _, name = key.rpartition(".")
    table = attrgetter(section)(scenario)
    return next((one for value in values for one in table.model_copy(update={name: value}).flaws()), None)


def too_much_turn(given: tuple[Any, ...], draw: Draw, numbers: tuple[Any, ...]) -> str | None:
    """Return a message if the pointing error of some case can reach 90 deg, or None."""
    if draw.choice is not None:
        most = max(hypot(*value) for value in numbers)
    else:
        corner = {"uniform": 3.0**0.5, "normal": 3.0**0.5 * NORMAL_REACH}.get(draw.kind, 1.0)
        most = max(hypot(*value) for value in given) + corner * numbers[-1]
    return None if most < MOST_TURN else "some body is turned by 90 deg or more; draw less"


def drawn_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if a study draws errors that are absent or unsupported."""
    if not scenario.uncertain:
        yield (
            "study.draws: no craft has errors; add for example "
            f"covariance = {Craft.examples()['covariance']} to [craft]"
        )
    searches = [number for number, stage in enumerate(scenario.stages, 1) if stage.searches]
    replanned = scenario.study is not None and scenario.study.draws == "replanned"
    if scenario.noisy and replanned and searches:
        yield (
            f"study.draws: craft search in stage {searches[0]} as they coast, without white noise; remove "
            'noise from execution, or write draws = "errors"'
        )


def somebody_to_meet(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if a study of conflicts has no zones or no second craft."""
    if all(craft.keep_out is None and craft.hard_body is None for craft in scenario.craft):
        yield 'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }'
    if len(scenario.craft) < 2:
        yield "study.draws: needs another craft; add one"
