import signal
import threading

import pytest

from upright.support.interrupts import (
    ENDING,
    ending_like_ctrl_c,
    hold_interrupts,
    let_interrupts_through,
)


def interrupt():
    signal.raise_signal(signal.SIGINT)


def until_interrupted(work):
    """Return what was noted by work that ends with an interrupt."""
    notes = []
    with pytest.raises(KeyboardInterrupt):
        work(notes.append)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return notes


def test_an_interrupt_is_held_until_it_is_let_through():
    def work(note):
        with hold_interrupts():
            interrupt()
            note("held")
            with let_interrupts_through():
                note("went on")

    assert until_interrupted(work) == ["held"]


def test_a_held_interrupt_is_raised_at_the_end():
    def work(note):
        with hold_interrupts():
            interrupt()
            note("held")
        note("went on")

    assert until_interrupted(work) == ["held"]


def test_an_interrupt_let_through_is_raised_at_once():
    def work(note):
        with hold_interrupts(), let_interrupts_through():
            interrupt()
            note("went on")

    assert until_interrupted(work) == []


def test_a_swallowed_interrupt_is_raised_at_the_end():
    def work(note):
        with hold_interrupts():
            with let_interrupts_through():
                try:
                    interrupt()
                except KeyboardInterrupt:  # as by Python itself, in a callback of what it frees
                    note("lost")
            note("went on")

    assert until_interrupted(work) == ["lost"]


def test_a_second_interrupt_is_raised_at_once():
    def work(note):
        with hold_interrupts():
            interrupt()
            note("held")
            interrupt()
            note("went on")

    assert until_interrupted(work) == ["held"]


def test_nested_holds_last_until_the_outer_one_ends():
    def work(note):
        with hold_interrupts():
            with hold_interrupts():
                interrupt()
            note("held")
            with hold_interrupts(), let_interrupts_through():
                note("went on")

    assert until_interrupted(work) == ["held"]


def test_sigterm_with_the_same_handler_is_held_too():
    def work(note):
        with hold_interrupts():
            signal.raise_signal(signal.SIGTERM)
            note("held")

    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        assert until_interrupted(work) == ["held"]
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("number", ENDING)
def test_signals_that_end_a_program_interrupt_it(number):
    def work(note):
        with ending_like_ctrl_c(), hold_interrupts():
            signal.raise_signal(number)
            note("held")

    assert until_interrupted(work) == ["held"]
    assert signal.getsignal(number) is signal.SIG_DFL


@pytest.mark.parametrize("number", ENDING)
def test_an_ignored_signal_stays_ignored(number):
    """As `nohup` has it for a terminal that is closed."""
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with ending_like_ctrl_c():
            signal.raise_signal(number)
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_an_error_is_not_hidden_by_an_interrupt():
    def work():
        with hold_interrupts():
            interrupt()
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        work()


@pytest.mark.parametrize("handler", [signal.SIG_IGN, signal.SIG_DFL, lambda *_: None])
def test_custom_sigint_handlers_are_kept(handler):
    before = signal.signal(signal.SIGINT, handler)
    try:
        with hold_interrupts(), let_interrupts_through():
            assert signal.getsignal(signal.SIGINT) == handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_are_left_alone():
    seen = []

    def work():
        with hold_interrupts(), let_interrupts_through():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]
