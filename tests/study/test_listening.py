"""Whoever calls a study hears all of it; the study itself prints nothing."""

from contextlib import contextmanager
from dataclasses import replace

from studies import quick

from infoplan.config import OwnDetectorConfig
from infoplan.study.listening import Listener
from infoplan.study.runner import run_study


class Ear:
    """Progress that keeps what it is told."""

    def __init__(self):
        self.workers, self.heard, self.label = 0, [], ""

    def __getattr__(self, name):
        return lambda *told: self.heard.append((name, *told))

    def listener(self) -> Listener:
        @contextmanager
        def follow(tasks, pace, kept):
            self.heard.append(("follow", [task.seed for task in tasks], kept))
            yield self
            self.heard.append(("over",))

        return Listener(lambda text, tone: self.heard.append(("say", text, tone)), follow)

    def told(self, name: str) -> list[tuple]:
        return [words[1:] for words in self.heard if words[0] == name]


def test_a_study_prints_nothing_and_tells_its_listener(tmp_path, capfd):
    config = replace(quick(), results_dir=str(tmp_path), seeds=2, backend="loky", n_jobs=1)
    ear = Ear()
    run_study([config], ear.listener())
    assert ear.told("follow") == [([0, 1], 0)]
    assert ear.heard[-1] == ("over",)
    assert ear.workers == 1
    assert [number for (number,) in ear.told("start")] == [0, 1]
    reports = [words for words in ear.told("report") if words[0] == 0]
    collected = [words[1] for words in reports]
    assert collected == sorted(collected)
    assert reports[0][1:] == (0, None)
    assert reports[-1][1] == 160
    assert next((words[0], words[2]) for words in ear.told("finish")) == (0, reports[-1][2])
    again = Ear()
    run_study([config], again.listener())
    assert again.heard == [("say", "2 of 2 missions are there already and are kept", "note")]
    assert capfd.readouterr() == ("", "")


def test_failures_and_what_workers_write_are_told_too(tmp_path, capfd, monkeypatch):
    (tmp_path / "shouting.py").write_text(
        "import sys\n\n\ndef loud(samples, model, rng):\n"
        "    print('a word of its own', file=sys.stderr)\n    raise ValueError('no')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    detector = OwnDetectorConfig(function="shouting.loud")
    config = replace(quick(), results_dir=str(tmp_path / "results"), detector=detector)
    ear = Ear()
    study = run_study([config], ear.listener())
    ((number, reason),) = ear.told("fail")
    assert number == 0
    assert "ValueError: no" in reason
    assert len(study.failed) == 1
    assert any("a word of its own" in text for (text,) in ear.told("overhear"))
    assert capfd.readouterr() == ("", "")
