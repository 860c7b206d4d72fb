"""One mission: the paper's Algorithm 1."""

from collections.abc import Iterator
from dataclasses import replace

from infoplan.belief import Belief
from infoplan.config import MissionConfig, is_survey
from infoplan.cross_validation import cross_validate
from infoplan.culprit import culprit_named
from infoplan.mission_cost import check_mission
from infoplan.samples import Batch, joined
from infoplan.scoring import State, assess
from infoplan.source import Source


def explore(config: MissionConfig, source: Source, seed: int) -> Iterator[State]:
    """Fly a mission, yielding its state after the pilot and after each epoch.

    Parameters
    ----------
    config
        Its options, valid (`infoplan.config.validate`).
    source
        What gives the samples.
    seed
        Of all random streams.

    Raises
    ------
    UsageError
        If a planner, detector or model of the user's own cannot be had, or the mission needs more
        memory than the machine has.
    RunError
        If a planner, detector or model fails, or gives what it should not.
    """
    check_mission(config)
    with culprit_named(config, "on the pilot samples"):
        collected = source.pilot()  # line 1
        # Lines 2, 3 and 5.
        belief = Belief(config, source.extent, seed, collected.readings(), source.obstacles)
        state = _assess(config, belief, collected, source)
    yield state
    while belief.collected < config.budget:  # line 4
        with culprit_named(config, f"in epoch {belief.epoch + 1}"):
            trajectory = belief.plan() if source.is_steered else None  # line 6
            batch = source.sample(belief.epoch + 1, trajectory)  # line 7
            belief.learn(batch.readings())  # lines 8 to 10, and 5 of the next epoch
            collected = joined(collected, batch)
            state = _assess(config, belief, collected, source)
        yield state


def _assess(config: MissionConfig, belief: Belief, collected: Batch, source: Source) -> State:
    """Compare a belief with the truth, or where nobody knows it with its own samples."""
    state = assess(belief, collected, source.grid_truth, source.grid_third)
    if not is_survey(config.terrain.name):
        return state
    return replace(state, stretches=cross_validate(belief))
