"""Checks of what the sensor said: truth, noise, number and size of the spikes."""

import math

import numpy as np
import pandas as pd
from scipy import stats
from scipy.interpolate import RegularGridInterpolator

from infoplan.analyse.audit.stored import (
    CHANCE,
    ROUNDING,
    SIGMAS,
    FaultError,
    Partial,
    StoredMission,
    demand,
    demand_close,
)
from infoplan.config import terrain_kind


def check_truth(mission: StoredMission) -> str | Partial:
    """Check that the truth of samples and map is the bilinear terrain, if the terrain is given."""
    terrain = mission.terrains.get(mission.option("terrain.sha256"))
    if terrain is None:
        name = mission.option("terrain.name")
        why = "is not to be had here"
        if terrain_kind(name) == "own":
            why = "is made by a function, and none that a results folder names is called"
        return Partial("", f"the truth, taken from the tables: the map {name} {why}")
    xmin, xmax, ymin, ymax = mission.extent
    rows, columns = terrain.shape
    axes = (np.linspace(ymin, ymax, rows), np.linspace(xmin, xmax, columns))
    surface = RegularGridInterpolator(axes, terrain, bounds_error=False, fill_value=None)
    largest = 0.0
    for name, table in (("node", mission.maps), ("sample", mission.samples)):
        expected = surface(table[["x2", "x1"]].to_numpy())
        found = table["truth"].to_numpy()
        demand_close(f"the truth of {name}", found, expected, mission.elevation_tolerance)
        largest = max(largest, float(np.abs(found - expected).max()))
    return f"truth within {largest:.1g} of the bilinear terrain"


def check_sensor(mission: StoredMission) -> str:
    """Check that measurements but for outliers are the truth plus the sensor's Gaussian noise."""
    sigma = float(mission.option("sensor.noise_std"))
    clean = np.flatnonzero(~mission.samples["is_outlier"].to_numpy())
    noise = (mission.samples["measured"] - mission.samples["truth"]).to_numpy()[clean]
    n = len(noise)
    # Every bound holds for an honest sensor but for a chance of CHANCE, shared by both sides.
    reach = stats.norm.isf(CHANCE / 2 / n) * sigma + mission.elevation_tolerance
    demand(
        np.abs(noise) <= reach,
        lambda i: f"{mission.place(clean[i])} is {noise[i]:.3g} off the truth and no outlier",
    )
    mean, std = float(noise.mean()), float(np.sqrt(np.mean(noise**2)))
    if not abs(mean) <= stats.norm.isf(CHANCE / 2) * sigma / math.sqrt(n) + reach * ROUNDING:
        raise FaultError(f"the noise has mean {mean:.3g} over {n} samples, sigma {sigma:g}")
    low, high = np.sqrt(stats.chi2.ppf([CHANCE / 2, 1 - CHANCE / 2], n) / n) * sigma
    if not low - mission.elevation_tolerance <= std <= high + mission.elevation_tolerance:
        raise FaultError(f"the noise has deviation {std:.4g} over {n} samples, not {sigma:g}")
    return f"noise of mean {mean:.3g} and deviation {std:.4g} over {n} samples"


def _spiked_epochs(mission: StoredMission) -> range:
    """Epochs whose batches get spikes."""
    return range(0 if mission.option("pilot.outliers") else 1, len(mission.curves))


def check_spike_count(mission: StoredMission) -> str:
    """Check that as many samples of each batch are spikes as rho and the rule of counting say."""
    spiked = mission.samples["is_outlier"].to_numpy()
    if not mission.option("pilot.outliers"):
        demand(
            ~spiked[mission.epoch == 0],
            lambda i: f"{mission.place(i)} is an outlier, but the pilot has none",
        )
    rho, rule = float(mission.option("rho")), mission.option("fault.count")
    sizes = {e: int(np.sum(mission.epoch == e)) for e in _spiked_epochs(mission)}
    for e, n in sizes.items():
        count = int(np.sum(spiked[mission.epoch == e]))
        if rule == "bernoulli":
            wrong = stats.binomtest(count, n, rho).pvalue < CHANCE / len(sizes)
        else:
            # A product such as 0.29 * 100 falls just short of the integer that is meant.
            exact = round(rho * n) if rule == "round" else math.floor(rho * n + ROUNDING)
            wrong = count != exact
        if wrong:
            raise FaultError(f"epoch {e} has {count} spikes in {n} samples at rho {rho:g}, {rule}")
    total, judged = int(np.sum(spiked)), sum(sizes.values())
    if rule == "bernoulli" and sizes and stats.binomtest(total, judged, rho).pvalue < CHANCE:
        raise FaultError(f"{total} spikes in {judged} samples at rho {rho:g}, bernoulli")
    return f"{total} spikes in {judged} samples of {len(sizes)} batches, {rule}"


def _spikes(mission: StoredMission) -> pd.DataFrame:
    """List the spikes: sample, signed size, and bounds of the data range of its batch.

    What the noisy value of a spiked sample was before is known to within `SIGMAS` only, and so are
    the quantiles of its batch: they rise with every value, which bounds them.
    """
    reach = SIGMAS * float(mission.option("sensor.noise_std"))
    quantiles = [float(q) for q in mission.option("fault.quantiles")]
    truth = mission.samples["truth"].to_numpy()
    measured = mission.samples["measured"].to_numpy()
    spiked = mission.samples["is_outlier"].to_numpy()
    records = []
    for e in _spiked_epochs(mission):
        batch = np.flatnonzero(mission.epoch == e)
        lowest = np.quantile(np.where(spiked, truth - reach, measured)[batch], quantiles)
        highest = np.quantile(np.where(spiked, truth + reach, measured)[batch], quantiles)
        # The range itself is no narrower than nothing.
        narrow = max(lowest[1] - highest[0], 0.0)
        records += [
            {
                "sample": i,
                "epoch": e,
                "rank": (position + 0.5) / len(batch),
                "batch": len(batch),
                "size": measured[i] - truth[i],
                "narrow": narrow,
                "wide": highest[1] - lowest[0],
            }
            for position, i in enumerate(batch)
            if spiked[i]
        ]
    return pd.DataFrame(
        records, columns=["sample", "epoch", "rank", "batch", "size", "narrow", "wide"]
    ).astype({"sample": np.int64, "epoch": np.int64})


def check_spike_size(mission: StoredMission) -> str:
    """Check that each spike is as high as an amplitude within its bounds makes it."""
    smallest, largest = (float(bound) for bound in mission.option("fault.amplitude"))
    reach = SIGMAS * float(mission.option("sensor.noise_std")) + mission.elevation_tolerance
    spikes = _spikes(mission)
    if spikes.empty:
        return "no spikes"
    size = spikes["size"].abs().to_numpy()
    low = smallest * spikes["narrow"].to_numpy() - reach
    high = largest * spikes["wide"].to_numpy() + reach
    demand(
        (size >= low) & (size <= high),
        lambda i: (
            f"{mission.place(spikes['sample'][i])} is a spike of {size[i]:.4g}, not within "
            f"{max(low[i], 0.0):.4g} and {high[i]:.4g}"
        ),
    )
    return f"{len(spikes)} spikes from {size.min():.4g} to {size.max():.4g}"


def _demand_one_sign(spikes: pd.DataFrame, mission: StoredMission) -> None:
    """Check that all spikes of a batch, each clear of the noise, point the same way."""
    for e, batch in spikes.groupby("epoch"):
        if batch["size"].min() < 0 < batch["size"].max():
            raise FaultError(f"the spikes of epoch {e} point both ways, fault.draw=batch")


def check_spike_draws(mission: StoredMission) -> str:
    """Check that amplitudes are uniform, signs and places in the batch even."""
    smallest, largest = (float(bound) for bound in mission.option("fault.amplitude"))
    reach = SIGMAS * float(mission.option("sensor.noise_std"))
    spikes = _spikes(mission)
    m = len(spikes)
    if m:
        # Without replacement the places spread less than this: the bound is on the safe side.
        variance = np.sum((1 - 1 / spikes["batch"] ** 2) / 12) / m**2
        shift = spikes["rank"].mean() - 0.5
        if not abs(shift) <= stats.norm.isf(CHANCE / 2) * math.sqrt(variance) + ROUNDING:
            raise FaultError(f"{m} spikes lie {shift:+.3f} of a batch off its middle on average")
    if mission.option("fault.draw") == "batch":
        _demand_one_sign(spikes[spikes["size"].abs() > reach], mission)
        spikes = spikes.drop_duplicates("epoch")  # one draw each
    middle = (spikes["narrow"] + spikes["wide"]) / 2
    # Only spikes far above the noise tell their sign and amplitude.
    blur = (reach + largest * (spikes["wide"] - spikes["narrow"]) / 2) / middle.where(middle > 0)
    clear = blur < 0.05 * (largest - smallest)
    k = int(clear.sum())
    if not k:
        return f"{m} spikes, none clear of the noise"
    positive = int((spikes["size"][clear] > 0).sum())
    if smallest > 0.05 * (largest - smallest) and stats.binomtest(positive, k).pvalue < CHANCE:
        raise FaultError(f"{positive} of {k} spikes point up")
    amplitude = (spikes["size"].abs() / middle)[clear].to_numpy()
    uniform = stats.uniform(smallest, largest - smallest)
    distance = stats.kstest(amplitude, uniform.cdf).statistic
    # An amplitude that is off by its blur moves the distribution by no more than that share.
    certain = distance - float(blur[clear].max()) / (largest - smallest)
    if certain > 0 and stats.kstwo.sf(certain, k) < CHANCE:
        raise FaultError(
            f"the amplitudes of {k} spikes, mean {amplitude.mean():.3f}, are not uniform in "
            f"[{smallest:g}, {largest:g}]"
        )
    return f"{k} clear spikes: mean amplitude {amplitude.mean():.3f}, {positive} point up"
