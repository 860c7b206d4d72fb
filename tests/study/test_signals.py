"""Signals that stop a study wait while something is not to be left half done."""

import os
import signal

import pytest

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


def test_what_the_user_ignores_stays_ignored():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with stoppable():
            os.kill(os.getpid(), signal.SIGTERM)
            with postponed():
                os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
