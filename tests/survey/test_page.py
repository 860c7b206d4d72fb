"""What a survey's page holds is what the tables hold, and what others would predict."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from survey_logs import HOSTILE, QUICK, SPIKES, first_log, second_log, write_hostile_log, write_log

from infoplan.analyse import verdicts
from infoplan.cli import main

pyproj = pytest.importorskip("pyproj")


def survey(folder: Path, log: Path, *options: str) -> Path:
    """Survey a log; returns the folder of what one takes away."""
    assert main(["survey", str(log), f"results_dir={folder / 'results'}", *options]) == 0
    (found,) = (folder / "results" / "surveys").iterdir()
    return found


def data_of(page: Path) -> dict:
    """Read what the page's script reads."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>',
                      page.read_text(encoding="utf-8"), re.DOTALL)  # fmt: skip
    return json.loads(found[1])


def unpacked(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Folder and name of a survey, and its page's data."""
    folder = tmp_path_factory.mktemp("page")
    lines = write_log(folder / "bay.csv").read_text().splitlines()
    # One sample has no value, two are out of order, one row is no sample.
    lines[30] = re.sub(r",[\d.]+,n", ",,n", lines[30])
    lines[9], lines[10] = lines[10], lines[9]
    lines.insert(20, "2024-05-01T10:00:18Z,17.97,-67.04,deep,?")
    (folder / "bay.csv").write_text("\n".join(lines) + "\n")
    found = survey(folder, folder / "bay.csv", *QUICK)
    return folder, found, data_of(found / "page.html")


def table(folder: Path, name: str, run: str) -> pd.DataFrame:
    return pd.read_parquet(folder / "results" / name / f"run={run}" / "seed=0.parquet")


def test_samples_verdicts_and_layers_are_those_of_the_tables(done):
    folder, found, data = done
    samples = table(folder, "samples", found.name).dropna(subset="measured")
    maps = table(folder, "maps", found.name)
    clean = pd.read_csv(found / "clean.csv")
    place = data["samples"]
    assert unpacked(place["x"], "<f4") == pytest.approx(samples["x1"].to_numpy(), rel=1e-6)
    assert unpacked(place["y"], "<f4") == pytest.approx(samples["x2"].to_numpy(), rel=1e-6)
    value, row = unpacked(place["value"], "<f8"), unpacked(place["row"], "<i4")
    assert value.tolist() == samples["measured"].tolist()
    # Rows and times are those of the cleaned log, whatever the order.
    of_row = clean.iloc[row - 1]
    assert of_row["Depth (ft)"].astype(float).tolist() == value.tolist()
    assert of_row["time"].tolist() == place["time"]
    own = data["detectors"][0]
    assert own["name"] == "gp_residual"
    assert own["threshold"] == 3.0
    flagged = unpacked(own["flagged"], "u1").astype(bool)
    assert flagged.tolist() == (of_row["flagged"].astype(str) == "True").tolist()
    assert flagged.sum() == len(SPIKES)
    assert unpacked(own["score"], "<f4") == pytest.approx(of_row["score"].to_numpy(), rel=1e-5)
    assert [one["name"] for one in data["layers"]] == ["mean", "deviation", "density"]
    for layer, column in zip(data["layers"], ("mean", "std", "outlier_density"), strict=True):
        values = unpacked(layer["values"], "<f4")
        assert values == pytest.approx(maps[column].to_numpy(), rel=1e-6)
        assert layer["range"] == pytest.approx([maps[column].min(), maps[column].max()])
    # Colours are those of what was measured and kept, not of what the model makes of far places.
    kept = samples["measured"][~samples["flagged"]]
    ends = [(layer["low"], layer["high"]) for layer in data["layers"]]
    most = min(maps["std"].max(), kept.std(ddof=0))
    assert ends[0] == (kept.min(), kept.max())
    assert ends[1] == pytest.approx((maps["std"].min(), most))
    assert ends[2] == pytest.approx((0, maps["outlier_density"].max()), abs=1e-6)
    assert data["value"] == "Depth"
    assert data["unit"] == "ft"


def test_every_detector_has_flags_that_follow_its_threshold(done):
    _, found, data = done
    names = [one["name"] for one in data["detectors"]]
    assert names[0] == "gp_residual"
    assert set(names) == {"gp_residual", "copod", "local", "hampel", "qartod"}
    text = (found / "page.html").read_text()
    rows = re.findall(r"<tr>(.*?)</tr>", text[text.index("flagged by both<") :])
    cells = [re.findall(r">([^<>]+)<", row) for row in rows]
    agreed = pd.DataFrame({name: map(int, counts) for name, *counts in cells}, index=names)
    flags = {one["name"]: unpacked(one["flagged"], "u1").astype(bool) for one in data["detectors"]}
    for one in data["detectors"]:
        score = unpacked(one["score"], "<f4")
        assert flags[one["name"]].tolist() == (score > one["threshold"]).tolist()
    for a in names:
        for b in names:
            assert agreed.loc[a, b] == agreed.loc[b, a] == (flags[a] & flags[b]).sum()
    # The hampel filter by hand, on the values in order of time.
    y = unpacked(data["samples"]["value"], "<f8")
    score = [
        abs(y[i] - np.median(near)) / (1.4826 * np.median(np.abs(near - np.median(near))))
        for i in range(len(y))
        for near in [y[max(0, i - 5) : i + 6]]
    ]
    hampel = data["detectors"][names.index("hampel")]
    assert unpacked(hampel["score"], "<f4") == pytest.approx(np.array(score), rel=1e-5)


@pytest.mark.parametrize("name", ["gp_residual", "local"])
def test_expected_values_are_those_of_scikit_learn(done, name):
    folder, found, data = done
    samples = table(folder, "samples", found.name).dropna(subset="measured")
    row = table(folder, "curves", found.name).iloc[-1]
    pilot = (samples["epoch"] == 0).to_numpy()
    x, y = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    low, high = x[pilot].min(axis=0), x[pilot].max(axis=0)
    x = 2 * (x - low) / (high - low) - 1
    centre, scale = y[pilot].mean(), y[pilot].std()
    kernel = ConstantKernel(row["amplitude"] ** 2) * RBF(
        [float(row["lengthscale_1"]), float(row["lengthscale_2"])]
    )
    one = next(one for one in data["detectors"] if one["name"] == name)
    flagged = unpacked(one["flagged"], "u1").astype(bool)
    expected = unpacked(one["expected"], "<f4")
    for i in [*np.flatnonzero(flagged)[:3], 0, 25, 60, 78]:
        others = ~flagged & (np.arange(len(y)) != i)
        model = GaussianProcessRegressor(
            kernel, alpha=row["noise_std"] ** 2 + row["jitter"], optimizer=None
        )
        model.fit(x[others], (y[others] - centre) / scale)
        assert expected[i] == pytest.approx(centre + scale * model.predict(x[[i]])[0], rel=1e-4)


def test_a_model_of_linear_cost_expects_the_same(tmp_path):
    log = write_log(tmp_path / "bay.csv")
    options = ["grid=[9,8]", "model.pilot_iterations=0", "model.iterations=0"]
    found = {}
    for model, own in (("gp", []), ("vecchia", ["model.neighbours=100"])):
        page = survey(tmp_path / model, log, *options, f"model={model}", *own) / "page.html"
        found[model] = data_of(page)["detectors"]
    for one, other in zip(found["gp"], found["vecchia"], strict=True):
        values = [unpacked(each["expected"], "<f4") for each in (one, other)]
        assert values[0] == pytest.approx(values[1], abs=1e-4)
        assert np.isfinite(values[0]).all()


def test_the_polynomials_are_the_projection(done):
    folder, _, data = done
    clean = pd.read_csv(folder / "bay.csv")
    xmin, xmax, ymin, ymax = data["extent"]
    x, y = (unpacked(data["samples"][side], "<f4").astype(float) for side in "xy")
    row = unpacked(data["samples"]["row"], "<i4") - 1
    u, v = (2 * x - xmin - xmax) / (xmax - xmin), (2 * y - ymin - ymax) / (ymax - ymin)
    for name, column in (("lat", "Latitude"), ("lon", "Longitude")):
        found = np.polynomial.polynomial.polyval2d(u, v, np.array(data["degrees"][name]))
        assert found == pytest.approx(clean[column].to_numpy()[row], abs=2e-8)


def test_degrees_go_on_across_the_date_line_and_are_exact_on_a_large_map():
    from infoplan.draw.survey_page_data import degrees

    # 100 km, across the meridian of 180 degrees.
    origin, extent = (190_000.0, 5_200_000.0), (0.0, 100_000.0, 0.0, 80_000.0)
    found = degrees(extent, origin, "EPSG:32601")
    to = pyproj.Transformer.from_crs("EPSG:32601", "EPSG:4326", always_xy=True)
    for u, v in ((-1, -1), (1, -1), (0.3, -0.7), (-0.9, 1)):
        place = origin[0] + 50_000 * (u + 1), origin[1] + 40_000 * (v + 1)
        lon, lat = to.transform(*place)
        assert np.polynomial.polynomial.polyval2d(u, v, found["lat"]) == pytest.approx(
            lat, abs=1e-7
        )
        off = np.polynomial.polynomial.polyval2d(u, v, found["lon"]) - lon
        assert (off + 180) % 360 - 180 == pytest.approx(0, abs=1e-7)


def test_nothing_of_a_log_breaks_out(tmp_path):
    log = write_hostile_log(tmp_path)
    page = survey(tmp_path, log, *QUICK, "unit=</script><b>")
    text = (page / "page.html").read_text()
    assert text.count("<script") == text.count("</script>") == 2
    assert text.count("<b>") == text.count("<img") == 0
    data = data_of(page / "page.html")
    assert data["value"] == HOSTILE
    assert data["unit"] == "</script><b>"
    assert data["degrees"] is None
    assert data["crs"] is None


def test_what_takes_long_is_left_out_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(verdicts, "MOST_PAIRED", 70)
    monkeypatch.setattr(verdicts, "MOST_LEFT_OUT", 70)
    log = write_log(tmp_path / "bay.csv")
    page = survey(tmp_path, log, *QUICK, "detector=local") / "page.html"
    detectors = {one["name"]: one for one in data_of(page)["detectors"]}
    assert set(detectors) == {"local", "copod", "hampel", "qartod"}
    text = page.read_text()
    assert "Gp_residual is left out: with model=gp it looks at all pairs of samples" in text
    assert "expected values of more than 70 samples take long" in text
    flagged = unpacked(detectors["local"]["flagged"], "u1").astype(bool)
    expected = unpacked(detectors["local"]["expected"], "<f4")
    assert np.isfinite(expected).tolist() == flagged.tolist()


def test_what_later_logs_say_is_that_of_the_origins(tmp_path):
    logs = [str(first_log(tmp_path / "may.csv")), str(second_log(tmp_path / "june.csv"))]
    assert main(["survey", *logs, f"results_dir={tmp_path / 'r'}", *QUICK, "detector=local"]) == 0
    (page,) = (tmp_path / "r" / "surveys").glob("*/page.html")
    data, origins = data_of(page), pd.read_parquet(tmp_path / "r" / "origins")
    told = [data["later_words"][code] for code in unpacked(data["samples"]["later"], "u1")]
    assert told == origins["verdict"].fillna("").astype(str).tolist()
    assert {"confirmed", "cleared", "untested"} <= set(told)
    assert "Flags of each log when it was the last" in page.read_text()
    picture = pd.read_csv(page.with_name("picture.csv"))
    assert picture["log"].value_counts().to_dict() == {"may": 100, "june": 42}


def test_of_several_logs_each_sample_tells_its_own(tmp_path):
    first = write_log(tmp_path / "bay.csv")
    second = tmp_path / "bight.csv"
    lines = write_log(second).read_text().replace("2024-05-01", "2024-05-02").splitlines()
    del lines[1:11]
    second.write_text("\n".join(lines) + "\n")
    assert main(["survey", str(first), str(second), f"results_dir={tmp_path / 'r'}", *QUICK]) == 0
    (page,) = (tmp_path / "r" / "surveys").glob("*/page.html")
    data = data_of(page)
    assert data["logs"] == ["bay", "bight"]
    log, row = (unpacked(data["samples"][name], "<i4") for name in ("log", "row"))
    value = unpacked(data["samples"]["value"], "<f8")
    tables = [pd.read_csv(path) for path in (first, second)]
    assert np.bincount(log).tolist() == [80, 70]
    for i in (0, 17, 79, 80, 149):
        own = tables[log[i]].iloc[row[i] - 1]
        assert (own["Depth (ft)"], own["time"]) == (value[i], data["samples"]["time"][i])
