"""Displays the prediction of a tree's runs as text, as JSON or as an SVG plot."""

import math
from collections.abc import Iterator
from html import escape
from importlib.resources import files

from sar_compiler.analysis.merging import merging_notes
from sar_compiler.analysis.predict import Prediction
from sar_compiler.analysis.predict.weighed_graph import ProbabilityBounds
from sar_compiler.style import literal
from sar_compiler.tree.plain import as_json, count_with_noun

_SHARES = (0.05, 0.5, 0.95)
"""The quantiles of a run's duration that are reported."""
_MAX_LEAVES = 8
# The size and the margins of the plot, in its own units.
_WIDTH, _HEIGHT, _LEFT, _BELOW, _ABOVE = 640, 360, 56, 44, 20
_MAX_POINTS = 400


def prediction_as_text(prediction: Prediction, seconds: float) -> str:
    """Return the prediction as text: probabilities, times, and a line for each of the top leaves.

    Args:
        prediction: The prediction.
        seconds: The computation time, in seconds.
    """
    return "\n".join(_lines(prediction, seconds))


def _lines(found: Prediction, seconds: float) -> Iterator[str]:
    states, steps = count_with_noun(found.states, "state"), count_with_noun(found.steps, "step")
    yield f"{states}{'' if found.complete else ' and more'}, {steps} between them, {seconds:.1f} s"
    rows = [("success", _percent(found.success)), ("an end", _percent(found.ends))]
    rows += [("time", _time(found))] if found.time_sec else []
    rows += [("time to success", _seconds(found.success_sec))] if found.success_sec else []
    rows += [(name, _percent(probability)) for name, probability in found.properties.items()]
    width = max(len(name) for name, _ in rows) + 1
    yield from (f"  {name + ':':{width}} {value}" for name, value in rows)
    for each in found.left_out:
        yield f"  {each.name}: left out, because this tree has no {', '.join(each.missing)}"
    yield from _influence_lines(found)
    if found.unknown:
        names = ", ".join("/".join(path) for path in found.unknown)
        yield f"\nThe probabilities of these leaves are unknown, so some numbers have two bounds: {names}"
    for reason in found.undecided:
        yield f"\nSome runs are undecided, so some numbers have two bounds: {reason}"
    yield from (f"\n{note}" for note in merging_notes(found.merged))
    if not found.complete:
        yield (
            "\nNot all states were explored, so the bounds are wide. A time interval requires a state for each "
            "tick in the interval. Write a single time for each outcome (sec: 30), omit times on which no time limit "
            "depends, or increase the time between ticks (--period)."
        )


def _influence_lines(found: Prediction) -> Iterator[str]:
    leaves = found.influences[:_MAX_LEAVES]
    if not leaves:
        return
    width = max(len("/".join(each.leaf)) for each in leaves)
    yield f"\nSensitivity of success{', with unknown probabilities set to the middle of their bounds' if found.unknown else ''}:"
    yield f"  {'leaf':{width}}      gain per point  if it never failed"
    for each in leaves:
        gain = f"{each.derivative:+.2f} points"
        yield f"  {'/'.join(each.leaf):{width}}  {gain:>18}  {100 * each.if_never_failed:>16.1f} %"


def _percent(probability: ProbabilityBounds) -> str:
    low, high = (f"{100 * each:.1f}" for each in probability)
    return f"{low} %" if low == high else f"{low} to {high} %"


def _seconds(time_sec: ProbabilityBounds | None) -> str:
    if time_sec is None:
        return ""
    low, high = (f"{each:.1f}" for each in time_sec)
    return f"{low} s" if low == high else f"{low} to {high} s"


def _time(found: Prediction) -> str:
    quantiles = [(share, found.quantile(share)) for share in _SHARES]
    shares = ", ".join(f"{100 * share:g} % by {sec:.1f} s" for share, sec in quantiles if sec is not None)
    return f"{_seconds(found.time_sec)}{f' ({shares})' if shares else ''}"


def prediction_as_json(prediction: Prediction, seconds: float) -> str:
    """Return a prediction as a JSON object. The arguments are those of `prediction_as_text`."""

    def numbers(between: ProbabilityBounds | None) -> dict[str, float] | None:
        return None if between is None else {"low": between.low, "high": between.high}

    data = {
        "success": numbers(prediction.success),
        "end": numbers(prediction.ends),
        "properties": {name: numbers(probability) for name, probability in prediction.properties.items()},
        "time_sec": numbers(prediction.time_sec),
        "success_sec": numbers(prediction.success_sec),
        "quantiles_sec": {f"{share:g}": prediction.quantile(share) for share in _SHARES},
        "leaves": [
            {
                "leaf": "/".join(each.leaf),
                "derivative": each.derivative,
                "if_never_failed": each.if_never_failed,
            }
            for each in prediction.influences
        ],
        "unknown": ["/".join(path) for path in prediction.unknown],
        "undecided": list(prediction.undecided),
        "left_out": [{"property": each.name, "missing": list(each.missing)} for each in prediction.left_out],
        "not_distinguished": list(merging_notes(prediction.merged)),
        "states": prediction.states,
        "steps": prediction.steps,
        "complete": prediction.complete,
        "stopped": prediction.stopped,
        "seconds": round(seconds, 3),
    }
    return as_json(data)


def prediction_as_svg(prediction: Prediction) -> str:
    """Return an SVG plot of the probabilities that a run has ended or succeeded, as functions of time."""
    distribution = prediction.distribution
    last_sec = distribution[-1][0] or 1.0
    wide, high = _WIDTH - _LEFT - _ABOVE, _HEIGHT - _BELOW - _ABOVE

    def line(values: list[tuple[float, float]], name: str) -> str:
        points = [(float(_LEFT), float(_ABOVE + high))]
        for sec, share in values[:: max(1, len(values) // _MAX_POINTS)] + values[-1:]:
            x, y = _LEFT + wide * sec / last_sec, _ABOVE + high * (1.0 - share)
            points += [(x, points[-1][1]), (x, y)]
        drawn = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        return f'<path class="{name}" d="M{drawn}"><title>{name}</title></path>'

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{_HEIGHT}" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img">',
        f"<title>the probabilities that a run has ended, and that it has succeeded, as functions of time: {escape(_time(prediction))}</title>",
        f"<style>\n{literal(files(__package__).joinpath('prediction.css').read_text('utf-8'))}</style>",
        f'<rect class="ground" width="{_WIDTH}" height="{_HEIGHT}"/>',
        *_axes(last_sec, wide, high),
        line([(sec, ended) for sec, _, ended in distribution], "ended"),
        line([(sec, succeeded) for sec, succeeded, _ in distribution], "succeeded"),
        f'<text class="ended" x="{_LEFT + 8}" y="{_ABOVE + 14}">ended</text>',
        f'<text class="succeeded" x="{_LEFT + 8}" y="{_ABOVE + 30}">succeeded</text>',
        "</svg>",
    ]
    return "".join(f"{each}\n" for each in lines)


def _axes(last_sec: float, wide: float, high: float) -> Iterator[str]:
    for part in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _ABOVE + high * (1.0 - part)
        yield f'<path class="axis" d="M{_LEFT} {y:.1f}H{_LEFT + wide}"/>'
        yield f'<text class="scale" x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{100 * part:g} %</text>'
    # The largest round interval, in seconds, that the time axis contains at least three times.
    power = 10.0 ** math.floor(math.log10(last_sec))
    step = next(each * power for each in (2.0, 1.0, 0.5, 0.2) if 3.0 * each * power <= last_sec)
    for number in range(int(last_sec / step) + 1):
        x = _LEFT + wide * number * step / last_sec
        yield f'<text class="scale" x="{x:.1f}" y="{_ABOVE + high + 18}" text-anchor="middle">{number * step:.4g}</text>'
    yield f'<text class="scale" x="{_LEFT + wide / 2}" y="{_HEIGHT - 8}" text-anchor="middle">time, s</text>'
