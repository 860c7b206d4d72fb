"""Checks of what was flagged: scores, flags, confusion counts, outlier density."""

from itertools import repeat as repeat_forever
from typing import Any

import numpy as np
from scipy import stats
from scipy.ndimage import gaussian_filter

from infoplan.analyse.audit import neighbours, repeat
from infoplan.analyse.audit.model import (
    neighbourhoods,
    noise_factor,
    reference_kernel,
    scaled_samples,
)
from infoplan.analyse.audit.neighbours import Neighbourhood
from infoplan.analyse.audit.stored import (
    ROUNDING,
    Booleans,
    FaultError,
    Floats,
    Integers,
    Partial,
    StoredMission,
    demand,
    demand_close,
)
from infoplan.backend import load_matplotlib
from infoplan.wording import spans

LARGEST_PARAMETER = 100_000
"""Numbers in the parameters of a detector of PyOD above which it is not repeated."""

REPEATED = ("none", "best", "copod", "local", "hampel", "qartod", "gp_residual")
"""Detectors that `_judge` knows, those of PyOD besides."""

COMPARING, MOST_COMPARED = ("gp_residual", "local"), 5000
"""Detectors that are repeated pair by pair, and up to how many samples all of them are."""

CHOSEN, MOST_FLAGGED = 500, 2000
"""Of more, so many that are not flagged are judged again, and all flagged ones, up to so many."""

LARGEST_FILTER = 1e10
"""Multiplications for smoothing the outlier matrix above which it is not repeated."""

REPLAYED_PRECISION = 1e-6
"""Relative difference allowed to a score that comes from a solve with the model's covariance."""


def replay_detector(mission: StoredMission) -> list[tuple[Floats, Booleans] | None]:
    """Judge the samples again, epoch by epoch, on what was there by then.

    Returns
    -------
    list of (scores, flags) or None
        One entry for each epoch, of all samples collected by then, as the mission then held them:
        scope batch keeps a sample's first judgement, historical the latest; the pilot is judged
        by historical and by `detector.judge_pilot` only. None where a detector that cannot be
        repeated has judged since; what it said at last is taken from the table.
    """
    if _unrepeatable(mission):
        return _stored_judgements(mission)
    if _is_long(mission):
        return _judged_in_part(mission)
    historical = mission.option("detector.scope") == "historical"
    scores, flags = _judge_pilot(mission)
    judgements: list[tuple[Floats, Booleans] | None] = [(scores, flags)]
    has_neighbours = mission.option("model.name") == "vecchia"
    taught = neighbourhoods(mission, judgements) if has_neighbours else repeat_forever(None)
    for e in range(1, len(mission.curves)):
        n = int(np.sum(mission.epoch <= e))
        kept = 0 if historical else len(scores)
        accepted = np.append(~flags[:kept], np.ones(n - kept, dtype=bool))
        new_scores, new_flags = _judge_told(
            mission, e, accepted, np.arange(n) >= kept, np.flatnonzero(~flags), next(taught)
        )
        scores = np.concatenate([scores[:kept], new_scores[kept:]])
        flags = np.concatenate([flags[:kept], new_flags[kept:]])
        judgements.append((scores, flags))
    return judgements


def _judge_pilot(mission: StoredMission) -> tuple[Floats, Booleans]:
    """Judge the pilot, if it was, before any model that is known."""
    n, nobody = mission.n_pilot, np.empty(0, dtype=np.int64)
    judged = np.full(n, bool(mission.option("detector.judge_pilot")))
    return _judge_told(mission, 0, np.ones(n, dtype=bool), judged, nobody, None)


def _unrepeatable(mission: StoredMission) -> str:
    """Say why the detector cannot be repeated, as when it is the user's own; empty if it can."""
    name = str(mission.option("detector.name"))
    if mission.is_own("detector"):
        return "the detector is the user's own"
    if name not in REPEATED and not name.startswith("pyod_"):
        return f"the audit does not know detector={name}"
    if name == "gp_residual" and mission.is_own("model"):
        return "the detector asks the model, which is the user's own"
    if name == "gp_residual" and mission.option("detector.judge_pilot"):
        return "the detector asked a model of the whole pilot, which no table holds"
    if _is_long(mission):
        n, flagged = len(mission.samples), int(mission.samples["flagged"].sum())
        if flagged > MOST_FLAGGED:
            return f"{flagged} samples are flagged, and up to {MOST_FLAGGED} are judged again"
        if name == "gp_residual" and mission.option("model.name") != "vecchia":
            return f"the model compares {n} samples with each other, {MOST_COMPARED} are repeated"
        if mission.option("detector.judge_pilot"):
            return f"a pilot that was judged is repeated with up to {MOST_COMPARED} samples"
        historical = mission.option("detector.scope") == "historical"
        if name == "gp_residual" and historical and len(mission.curves) > 2:
            return "the neighbours depend on the flags of earlier epochs, which are not stored"
    if name.startswith("pyod_") and not _is_tame(mission):
        return "the detector of PyOD might load or fetch something, or take for ever"
    return ""


def _is_long(mission: StoredMission) -> bool:
    """Tell whether a detector compares so many samples that a part of them is judged again."""
    compares = mission.option("detector.name") in COMPARING
    return compares and len(mission.samples) > MOST_COMPARED


def _chosen(mission: StoredMission) -> Booleans:
    """Choose whom to judge again, shape (n,): all that are flagged, and some others by the seed."""
    flagged = mission.samples["flagged"].to_numpy(dtype=bool) & mission.told
    judged = mission.told & ((mission.epoch > 0) | _is_historical(mission))
    others = np.flatnonzero(judged & ~flagged)
    rng = np.random.default_rng(mission.seed)
    chosen = flagged.copy()
    chosen[rng.choice(others, min(CHOSEN, len(others)), replace=False)] = True
    return chosen


def _is_historical(mission: StoredMission) -> bool:
    return bool(mission.option("detector.scope") == "historical")


def _judged_in_part(mission: StoredMission) -> list[tuple[Floats, Booleans] | None]:
    """Judge those of `_chosen` again, given all others as the table has them.

    A score follows from the samples around and from what was dropped before, which is flagged:
    so that those that are chosen are judged as they would be among all.
    """
    judgements, chosen = _stored_judgements(mission), _chosen(mission)
    has_neighbours = mission.option("model.name") == "vecchia"
    taught = neighbourhoods(mission, judgements) if has_neighbours else repeat_forever(None)
    stored = mission.samples["flagged"].to_numpy(dtype=bool)
    scores, flags = mission.samples["score"].to_numpy(copy=True), stored.copy()
    for e in range(1, len(mission.curves)):
        neighbourhood = next(taught)
        if judgements[e] is None:
            continue
        n = int(np.sum(mission.epoch <= e))
        asked = chosen[:n] & ((mission.epoch[:n] == e) | _is_historical(mission))
        candidates = ~stored[:n] | (mission.epoch[:n] == e) | _is_historical(mission)
        held = np.flatnonzero(~stored & (mission.epoch < e))
        if _is_historical(mission):  # then there is one epoch, before which nothing was flagged
            held = np.flatnonzero(mission.told & (mission.epoch < e))
        found = _judge_told(mission, e, candidates, asked, held, neighbourhood)
        scores[:n][asked], flags[:n][asked] = found[0][asked], found[1][asked]
        judgements[e] = scores[:n].copy(), flags[:n].copy()
    return judgements


def _left_out(mission: StoredMission) -> int:
    """Count the samples with a verdict that are not judged again."""
    if not _is_long(mission) or _unrepeatable(mission):
        return 0
    return int(np.isfinite(mission.samples["score"]).sum()) - int(_chosen(mission).sum())


def _is_tame(mission: StoredMission) -> bool:
    """Tell whether a detector of PyOD does nothing but compute, for all that its options say."""
    if "Embedding" in str(mission.option("detector.model")):
        return False
    return all(
        value is None
        or (isinstance(value, int | float) and abs(value) <= LARGEST_PARAMETER)
        or (isinstance(value, str) and value.isidentifier())
        for value in mission.option("detector.params").values()
    )


def _judge_told(
    mission: StoredMission,
    epoch: int,
    candidates: Booleans,
    judged: Booleans,
    held: Integers,
    neighbourhood: Neighbourhood,
) -> tuple[Floats, Booleans]:
    """Do as `_judge`, where samples without a measurement are flagged unseen."""
    told = mission.told[: len(judged)]
    scores, flags = np.full(len(judged), np.nan), ~told
    if judged[told].any():
        scores[told], flags[told] = _judge(
            mission, np.flatnonzero(told), epoch, candidates[told], judged[told], held,
            neighbourhood,
        )  # fmt: skip
    return scores, flags


def _judge(
    mission: StoredMission,
    samples: Integers,
    epoch: int,
    candidates: Booleans,
    judged: Booleans,
    held: Integers,
    neighbourhood: Neighbourhood,
) -> tuple[Floats, Booleans]:
    """Judge samples collected by the end of an epoch.

    Parameters
    ----------
    samples
        Their numbers, shape (n,).
    epoch
        Which.
    candidates
        What the model holds unless it is flagged now, shape (n,).
    judged
        Whose judgement counts, shape (n,).
    held, neighbourhood
        Numbers of the samples that the model holds, and, if it has such, their blocks.

    Returns
    -------
    scores, flags : ndarrays, shape (n,)
    """
    n, name = len(judged), str(mission.option("detector.name"))
    measured = mission.samples["measured"].to_numpy()[samples]
    if name == "copod":
        return _copod(mission, measured)
    if name == "local":
        scores = repeat.local_scores(
            mission.x[samples],
            measured,
            candidates,
            judged,
            int(mission.option("detector.neighbours")),
        )
        return scores, scores > float(mission.option("detector.threshold"))
    if name == "hampel":
        scores = repeat.hampel_scores(measured, judged, int(mission.option("detector.reach")))
        return scores, scores > float(mission.option("detector.threshold"))
    if name == "qartod":
        limits = {
            limit: mission.option(f"detector.{limit}")
            for limit in ("gross_range", "spike", "rate", "flat", "tolerance")
        }
        scores = repeat.qartod_scores(measured, judged, **limits)
        return scores, scores > 1.0
    if name == "gp_residual":
        x, y = scaled_samples(mission)
        state = mission.curves.iloc[epoch - 1]  # the model has not seen the batch
        noise = state["noise_std"] ** 2 * noise_factor(mission) + state["jitter"]
        noisy = (reference_kernel(mission, state), noise)
        accepted, asked = samples[candidates], samples[judged]
        residual, covariance = (
            _by_neighbours(mission, x, y, *noisy, accepted, asked, held, *neighbourhood)
            if neighbourhood
            else repeat.given_the_rest(x[samples], y[samples], *noisy, candidates, judged)
        )
        scores, flags = np.full(n, np.nan), np.zeros(n, dtype=bool)
        scores[judged], flags[judged] = repeat.leave_one_out(
            residual, covariance,
            float(mission.option("detector.threshold")),
            bool(mission.option("detector.one_by_one")),
        )  # fmt: skip
        return scores, flags
    if name.startswith("pyod_"):
        columns = {"x1": "x1", "x2": "x2", "y": "measured"}
        features = [columns[feature] for feature in mission.option("detector.features")]
        return repeat.pyod_judgement(
            mission.samples[features].to_numpy()[samples],
            str(mission.option("detector.model")),
            float(mission.option("detector.contamination")),
            mission.option("detector.params"),
            np.random.SeedSequence(mission.seed, spawn_key=(4, epoch)),
        )
    outlier = mission.samples["is_outlier"].to_numpy()[samples]
    return np.full(n, np.nan), outlier if name == "best" else np.zeros(n, dtype=bool)


def _by_neighbours(
    mission: StoredMission,
    x: Floats,
    y: Floats,
    kernel: Any,
    noise: float,
    accepted: Integers,
    asked: Integers,
    held: Integers,
    blocks: neighbours.Blocks,
    units: Floats,
) -> tuple[Floats, Floats]:
    """Do as `repeat.given_the_rest`, by numbers, in the distribution that a model's blocks make."""
    blocks = neighbours.taught(
        x, held, blocks, accepted, units, int(mission.option("model.block")),
        int(mission.option("model.neighbours")), str(mission.option("model.ordering")),
    )  # fmt: skip
    weights, precision = neighbours.information(x, y, kernel, noise, blocks, asked)
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    return covariance @ weights, covariance


def _stored_judgements(mission: StoredMission) -> list[tuple[Floats, Booleans] | None]:
    """Take the judgements of a detector that cannot be repeated from the table."""
    scores, flags = mission.samples["score"].to_numpy(), mission.samples["flagged"].to_numpy()
    last = len(mission.curves) - 1
    judgements: list[tuple[Floats, Booleans] | None] = []
    for e in range(last + 1):
        n = int(np.sum(mission.epoch <= e))
        unjudged = e == 0 and not mission.option("detector.judge_pilot")
        if unjudged:
            judgements.append((np.full(n, np.nan), ~mission.told[:n]))
        elif e == last or mission.option("detector.scope") == "batch":
            judgements.append((scores[:n], flags[:n]))
        else:
            judgements.append(None)
    return judgements


def _copod(mission: StoredMission, measured: Floats) -> tuple[Floats, Booleans]:
    """Score and flag measurements by COPOD (paper, Section IV-A), shapes (n,)."""
    contamination = float(mission.option("detector.contamination"))
    if mission.option("detector.score") == "pyod":
        # PyOD imports a plotting library: only an audit that needs it waits for that.
        load_matplotlib()
        from pyod.models.copod import COPOD

        detector = COPOD(contamination=contamination).fit(measured.reshape(-1, 1))
        return detector.decision_scores_, detector.labels_ == 1
    n = len(measured)
    left = np.array([np.count_nonzero(measured <= y) for y in measured]) / n
    right = np.array([np.count_nonzero(measured >= y) for y in measured]) / n
    corrected = left if stats.skew(measured) < 0 else right
    scores = np.max([-np.log(left), -np.log(right), -np.log(corrected)], axis=0)
    return scores, scores > np.percentile(scores, 100 * (1 - contamination))


def check_scores(mission: StoredMission) -> str | Partial:
    """Check that the detector's scores are PyOD's, or those of its formula."""
    if why := _unrepeatable(mission):
        return Partial("", f"the scores: {why}")
    judgement = mission.judgements[-1]
    assert judgement is not None
    expected, _ = judgement
    found = mission.samples["score"].to_numpy()
    solved = mission.option("detector.name") == "gp_residual"
    allowed = REPLAYED_PRECISION if solved else ROUNDING
    demand(
        np.isclose(found, expected, rtol=allowed, atol=allowed, equal_nan=True),
        lambda i: f"{mission.place(i)} has the score {found[i]:.6g}, not {expected[i]:.6g}",
    )
    count = int(np.isfinite(expected).sum())
    if left := _left_out(mission):
        told = f"{count - left} scores agree: of all flagged samples, and others drawn by the seed"
        return Partial(told, f"the scores of {left} of {count} samples")
    return f"{count} scores agree"


def check_flags(mission: StoredMission) -> str | Partial:
    """Check that the flags are the detector's, and what is not flagged is used."""
    judgement = mission.judgements[-1]
    assert judgement is not None
    _, expected = judgement
    flagged, used = mission.samples["flagged"].to_numpy(), mission.samples["used"].to_numpy()
    demand(
        flagged == expected,
        lambda i: f"{mission.place(i)} is {'' if flagged[i] else 'not '}flagged, wrongly",
    )
    demand(
        used != flagged,
        lambda i: f"{mission.place(i)} is {'both' if used[i] else 'neither'} flagged and used",
    )
    told = f"{flagged.sum()} of {len(flagged)} samples are flagged"
    if left := _left_out(mission):
        return Partial(told, f"the flags of {left} samples")
    return told


def check_confusion(mission: StoredMission) -> str | Partial:
    """Check that confusion counts and accepted samples of every epoch follow from the flags."""
    outlier, unknown = mission.samples["is_outlier"].to_numpy(), []
    historical = mission.option("detector.scope") == "historical"
    for e, judgement in enumerate(mission.judgements):
        n = int(np.sum(mission.epoch <= e))
        judged = (mission.epoch[:n] == e) | historical
        if e == 0 and not mission.option("detector.judge_pilot"):
            judged[:] = False
        spiked, stored = outlier[:n], mission.curves.iloc[e]
        if judgement is None:
            # Whatever was flagged, spikes and others add up.
            unknown.append(e)
            flagged = stored["tp"] + stored["fp"]
            expected = {
                "tp": int(np.sum(judged & spiked)) - stored["fn"],
                "fp": int(np.sum(judged & ~spiked)) - stored["tn"],
                "accepted": n - flagged if historical else stored["accepted"],
            }
            if min(stored[["tp", "fp", "fn", "tn"]]) < 0:
                raise FaultError(f"epoch {e} has a negative count")
        else:
            _, flags = judgement
            expected = {
                "accepted": int(np.sum(~flags)),
                "tp": int(np.sum(judged & flags & spiked)),
                "fp": int(np.sum(judged & flags & ~spiked)),
                "fn": int(np.sum(judged & ~flags & spiked)),
                "tn": int(np.sum(judged & ~flags & ~spiked)),
            }
        for column, count in expected.items():
            if stored[column] != count:
                raise FaultError(f"epoch {e} has {column} {stored[column]}, recounted {count}")
    counts = [f"{column} {mission.curves[column].sum()}" for column in ("tp", "fp", "fn", "tn")]
    detail = f"{len(mission.curves)} epochs recounted, sums {', '.join(counts)}"
    if unknown:
        return Partial(detail, f"flags of epochs {spans(unknown)}: their counts only add up")
    return detail


def check_density(mission: StoredMission) -> str | Partial:
    """Check that the outlier density is the smoothed count of flagged samples by nearest node."""
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    xmin, xmax, ymin, ymax = mission.extent
    extent, last = np.array([ymax - ymin, xmax - xmin]), np.array([rows - 1, columns - 1])
    counts = np.zeros((rows, columns))
    for x, y in mission.x[mission.samples["flagged"].to_numpy()]:
        # Multiplied before dividing: the car may start exactly half-way between two nodes.
        nearest = np.floor((np.array([y, x]) - [ymin, xmin]) * last / extent + 0.5).astype(int)
        row, column = np.clip(nearest, 0, last)
        counts[row, column] += 1
    sigma = float(mission.option("planner.smoothing")) * last / extent
    if 8 * float(sigma.sum()) * counts.size > LARGEST_FILTER:
        return Partial("", "the outlier density: planner.smoothing is so wide that it takes long")
    expected = gaussian_filter(counts, sigma, mode="nearest").ravel()
    found = mission.maps["outlier_density"].to_numpy()
    allowed = ROUNDING * max(1.0, float(counts.max()))
    demand_close("the outlier density at node", found, expected, allowed)
    return f"{counts.sum():.0f} flagged samples, largest density {expected.max():.4g}"
