"""Loaded by every Python that has this folder on its PYTHONPATH: missions that misbehave.

SABOTAGE is a list of ``what:seed``, split by commas: ``raise`` an error, be killed (``kill``), be
killed the first time only (``kill-once``, which notes in SABOTAGE_NOTES that it has been).
SLOW is a number of seconds that every epoch takes longer. FLOCK_FAILS is the name of the error that
every attempt at a lock ends in.
"""

import errno
import importlib.abc
import importlib.machinery
import os
import signal
import sys
import time
from pathlib import Path


class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name != "infoplan.mission":
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        execute = spec.loader.exec_module

        def exec_module(module):
            execute(module)
            sabotage(module)

        spec.loader.exec_module = exec_module
        return spec


def sabotage(module):
    honest = module.explore
    plan = dict.fromkeys(filter(None, os.environ.get("SABOTAGE", "").split(",")))

    def explore(config, source, seed):
        for state in honest(config, source, seed):
            if config.budget < 100:  # the one that compiles
                yield state
                continue
            time.sleep(float(os.environ.get("SLOW", "0")))
            if state.row.epoch == 1:
                for what, _, sabotaged in (entry.partition(":") for entry in plan):
                    if int(sabotaged) == seed:
                        misbehave(what, seed)
            yield state

    module.explore = explore


def misbehave(what, seed):
    if what == "raise":
        raise ArithmeticError(f"seed {seed} is sabotaged")
    note = Path(os.environ.get("SABOTAGE_NOTES", "/nonexistent")) / f"killed-{seed}"
    if what == "kill-once" and note.exists():
        return
    if what == "kill-once":
        note.touch()
    os.kill(os.getpid(), signal.SIGKILL)


def no_lock(descriptor, operation):
    number = getattr(errno, os.environ["FLOCK_FAILS"])
    raise OSError(number, os.strerror(number))


if "FLOCK_FAILS" in os.environ:
    import fcntl

    fcntl.flock = no_lock
sys.meta_path.insert(0, Finder())
