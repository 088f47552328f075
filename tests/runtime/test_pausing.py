"""What a generator that pauses depends on."""

import sys

from sar_compiler.runtime.pausing import held_by


def counting(most):
    number = 0
    while number < most:
        yield number
        number += 1


def paused():
    generator = counting(3)
    next(generator)
    return generator


def test_a_generator_depends_on_its_place_and_its_variables():
    one, other = paused(), paused()
    assert held_by(one)[:3] == held_by(other)[:3]
    assert {3, 0} <= {each for each in held_by(one)[3] if isinstance(each, int)}
    next(other)
    assert held_by(one) != held_by(other)


def test_whoever_watches_its_lines_is_nothing_that_it_depends_on():
    def watch(*_):
        return watch

    before = sys.gettrace()
    sys.settrace(watch)
    try:
        generator = paused()
    finally:
        sys.settrace(before)
    assert generator.gi_frame.f_trace is watch
    assert not any(each is watch for each in held_by(generator)[3])
