"""Signals that stop a study wait while something is not to be left half done."""

import os
import signal

import pytest

from infoplan.study import signals
from infoplan.study.signals import STOPPING, ignored, postponed, stoppable


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_counts_when_the_block_is_over(number):
    done = []

    def interrupted():
        with postponed():
            os.kill(os.getpid(), number)
            done.append("whole")

    with stoppable(), pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["whole"]


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_is_ignored_at_the_end(number):
    before = signal.getsignal(number)
    with ignored():
        os.kill(os.getpid(), number)
    assert signal.getsignal(number) == before


def test_impatience_does_not_disturb_the_end_and_patience_has_an_end(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(signals.time, "monotonic", lambda: now[0])
    with stoppable():
        with pytest.raises(signals.Interrupted):
            os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
        now[0] += signals.PATIENCE_SECONDS
        with pytest.raises(signals.Interrupted):
            os.kill(os.getpid(), signal.SIGTERM)


def test_a_process_that_was_interrupted_for_good_stays_deaf():
    before = {number: signal.getsignal(number) for number in STOPPING}
    try:
        with stoppable(for_good=True):
            pass
        assert {number: signal.getsignal(number) for number in STOPPING} == before
        with stoppable(for_good=True), pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_what_the_user_ignores_stays_ignored():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with stoppable():
            os.kill(os.getpid(), signal.SIGTERM)
            with postponed():
                os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
