"""A mission stepped by hand: infoplan plans, your robot drives and measures."""

import numpy as np

import infoplan

rng = np.random.default_rng(7)


def lake_depth(x):
    """Stands for the world, which infoplan does not know; x has shape (n, 2)."""
    return 12 * np.exp(-((x[:, 0] - 60) ** 2 + (x[:, 1] - 30) ** 2) / 800)


def drive_and_measure(trajectory):
    """Stands for your robot: it drifts a little, and an echo now and then is no ground."""
    x = np.clip(trajectory[:, :2] + 0.2 * rng.standard_normal((len(trajectory), 2)), 0, [100, 60])
    measured = lake_depth(x) + 0.1 * rng.standard_normal(len(x))
    echo = rng.random(len(x)) < 0.05
    return x, np.where(echo, measured + 15, measured)


config = infoplan.configure("planner=puct", "detector=copod", budget=300, grid=[25, 40])
lake = infoplan.workspace([0, 100, 0, 60], unit="m", name="lake")
mission = infoplan.Mission(config, lake, seed=0)

x, measured = drive_and_measure(mission.pilot_path())  # or any first survey of your own
mission.start(infoplan.as_samples(mission, x, measured))
rows = [mission.evaluate()]
while mission.collected < config.budget:
    trajectory = mission.plan()  # ask: poses x1, x2, heading, shape (n, 3)
    x, measured = drive_and_measure(trajectory)
    mission.observe(infoplan.as_samples(mission, x, measured))  # tell
    rows.append(mission.evaluate())

frames = infoplan.frames(mission, rows)
error = frames.maps["mean"] - lake_depth(frames.maps[["x1", "x2"]].to_numpy())
print(f"{mission.collected} samples, {frames.samples['flagged'].sum()} of them set aside as spikes")
print(f"depth is off by {np.sqrt(np.mean(error**2)):.2f} m (root mean square)")
