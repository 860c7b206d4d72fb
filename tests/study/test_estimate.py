"""How long a study takes, judged by missions that are done and those under way."""

import io
from dataclasses import replace

import pytest
from rich.console import Console
from studies import quick, study

from infoplan.draw.progress import listener
from infoplan.mission_cost import seconds_of
from infoplan.study import estimate
from infoplan.study.estimate import (
    PROGRESS,
    Clock,
    Kind,
    Pace,
    duration,
    kind_of,
    wall_seconds,
)
from infoplan.study.identity import identify
from infoplan.study.runner import plan_study


def kind(config, terrain):
    """Kind of the missions of a configuration on a map."""
    run = identify(config, terrain)
    return kind_of(run.science, run.config)


@pytest.fixture
def clock(monkeypatch):
    """Set the time that the estimates see."""
    now = [100.0]
    monkeypatch.setattr(estimate.time, "monotonic", lambda: now[0])

    def advance(seconds):
        now[0] += seconds

    return advance


def test_a_kind_that_is_known_takes_its_mean():
    pace, kind, other = Pace(), Kind("a", 8.0), Kind("b", 8.0)
    assert pace.seconds(kind) is None
    for seconds in (2.0, 4.0):
        pace.add(kind, seconds)
    pace.add(other, 100.0)
    assert pace.seconds(kind) == 3.0
    assert pace.of_kind(Kind("c", 8.0)) is None


def test_another_kind_is_scaled_from_the_nearest():
    pace = Pace()
    pace.add(Kind("small", 1.0), 50.0)
    pace.add(Kind("large", 100.0), 10.0)
    pace.add(Kind("large too", 100.0), 20.0)
    assert pace.seconds(Kind("larger", 200.0)) == pytest.approx(30.0)
    assert pace.seconds(Kind("tiny", 0.5)) == pytest.approx(25.0)


def test_rho_and_map_do_not_make_another_kind(small, volcano):
    base = kind(small, volcano)
    assert kind(replace(small, rho=0.3), volcano) == base
    assert kind(small, replace(volcano, sha256="1" * 64)) == base
    more = kind(replace(small, budget=320), volcano)
    assert more.work == seconds_of(replace(small, budget=320)) > base.work
    model = replace(small.model, iterations=9)
    assert kind(replace(small, model=model), volcano) != base


def test_time_grows_faster_than_the_samples(small, volcano, clock):
    """A mission of twice the budget takes five to six times as long, not twice."""
    base, double = (kind(replace(small, budget=budget), volcano) for budget in (800, 1600))
    pace = Pace()
    pace.add(base, 10.0)
    assert pace.seconds(double) == pytest.approx(10.0 * double.work / base.work)
    assert 25 < pace.seconds(double) < 90
    # Half of the samples are a twelfth of the work: 11.3 of 12.3 parts are left.
    mission = Clock(budget=1000)
    mission.report(0)
    clock(1.0)
    mission.report(1)
    clock(10.0)
    mission.report(500)
    assert mission.share(500) == pytest.approx(0.0884, abs=1e-4)
    assert mission.left(None) == pytest.approx(103.1, abs=0.1)


def test_stored_missions_teach_the_pace(tmp_path):
    study(quick(), tmp_path, seeds=3, backend="sequential")
    curve = next(tmp_path.glob("curves/*/seed=2.parquet"))
    curve.write_bytes(b"broken")
    pace = estimate.learn(tmp_path)
    ((_, seconds),) = pace.measured.items()
    assert len(seconds) == 2
    assert all(value > 0 for value in seconds)


def test_a_mission_under_way_is_judged_by_its_pace_after_the_pilot(clock):
    mission = Clock(budget=1000)
    assert mission.left(None) is None
    assert mission.left(60.0) == 60.0
    mission.report(0)
    clock(7.0)  # imports and the pilot's fit
    mission.report(100)
    assert mission.total() is None
    assert mission.left(60.0) == 53.0
    work = 20.0 / (1 - 0.1**PROGRESS)  # 20 s for all that follows the pilot
    for collected in (200, 500, 800):
        before = mission.latest[1]
        clock(work * (mission.share(collected) - before))
        mission.report(collected)
    assert mission.total() == pytest.approx(27.0)
    elapsed = 7.0 + work * (mission.share(800) - mission.share(100))
    assert mission.left(None) == pytest.approx(27.0 - elapsed)
    # What others of its kind took counts less the further it is.
    trust = mission.share(800)
    assert mission.left(50.0) == pytest.approx(trust * 27 + (1 - trust) * 50 - elapsed)


def test_time_left_is_never_negative(clock):
    mission = Clock(budget=1000)
    mission.report(0)
    clock(100.0)
    assert mission.left(10.0) == 0.0


def test_wall_time_of_several_workers():
    assert wall_seconds([], 3) == 0.0
    assert wall_seconds([10.0, 10.0, 10.0, 10.0], 2) == 20.0
    assert wall_seconds([10.0, 1.0], 8) == 10.0


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.44, "0.4 s"), (59.6, "60 s"), (600, "10 min"), (7200, "2.0 h")]
)
def test_durations_as_people_say_them(seconds, said):
    assert duration(seconds) == said


def test_the_longest_missions_are_started_first(tmp_path):
    configs = [
        replace(quick(), budget=budget, seeds=2, results_dir=str(tmp_path))
        for budget in (130, 190, 160)
    ]
    plan = plan_study(configs, listener(Console(file=io.StringIO())).say)

    def order():
        return [(task.run.config.budget, task.seed, task.number) for task in plan.todo(True)]

    assert order() == [(190, 0, 0), (190, 1, 1), (160, 0, 2), (160, 1, 3), (130, 0, 4), (130, 1, 5)]
    kinds = {run.config.budget: kind_of(run.science, run.config) for run, _ in plan.runs}
    for budget, seconds in ((130, 50.0), (160, 7.0), (190, 9.0)):
        plan.pace.add(kinds[budget], seconds)
    assert [budget for budget, _, _ in order()] == [130, 130, 190, 190, 160, 160]


def test_a_long_study_goes_in_order_but_for_its_end(tmp_path):
    """What is named first is whole first; in the last hundred missions the longest come first."""
    configs = [
        replace(quick(), budget=budget, seeds=40, results_dir=str(tmp_path))
        for budget in (130, 160, 190, 140, 180)
    ]
    plan = plan_study(configs, listener(Console(file=io.StringIO())).say)
    budgets = [task.run.config.budget for task in plan.todo(True)]
    assert budgets[:100] == [130] * 40 + [160] * 40 + [190] * 20
    assert budgets[100:] == [190] * 20 + [180] * 40 + [140] * 40
