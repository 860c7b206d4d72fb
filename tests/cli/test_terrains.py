"""Maps as a user meets them: ``infoplan terrain``, and ``infoplan run`` and ``audit`` on each."""

import os
import resource
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rasterio
import rasterio.shutil
from command import SMALL
from rasterio.transform import Affine
from usgs_dem import write_dem

from infoplan.cli import main

ON_A_MAP = [*(word for word in SMALL if word != "terrain=volcano"), "backend=sequential"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """One map in every format, the north first where a format says so."""
    folder = tmp_path_factory.mktemp("maps")
    rows, columns = np.mgrid[0:1201, 0:1201]
    whole = 1500 + 400 * np.sin(rows / 200) * np.cos(columns / 150)
    place = Affine(1 / 1200, 0, -123 - 1 / 2400, 0, -1 / 1200, 47 + 1 / 2400)
    write(folder / "hills.tif", whole, place)
    convert(folder / "hills.tif", folder / "N46W123.hgt", "SRTMHGT")
    part = whole[::30, ::30]
    write(folder / "part.tif", part, place)
    convert(folder / "part.tif", folder / "hills.asc", "AAIGrid")
    write_dem(folder / "hills.dem", part, 560_000, 5_120_000, 1000)
    np.save(folder / "hills.npy", part[::-1])
    np.savez(folder / "hills.npz", elevation=part[::-1])
    np.savetxt(folder / "hills.csv", part[::-1], delimiter=",")
    with zipfile.ZipFile(folder / "hills.zip", "w") as out:
        out.write(folder / "hills.dem", "deep/hills.dem")
    return folder


def write(path: Path, elevation: np.ndarray, place: Affine) -> None:
    rows, columns = elevation.shape
    with rasterio.open(
        path, "w", driver="GTiff", height=rows, width=columns, count=1,
        dtype="int16", crs="EPSG:4326", transform=place, nodata=-32768,
    ) as out:  # fmt: skip
        out.write(elevation.astype(np.int16), 1)


def convert(source: Path, path: Path, driver: str) -> None:
    with rasterio.Env(GDAL_PAM_ENABLED="NO"):
        rasterio.shutil.copy(source, path, driver=driver)


def test_a_study_over_every_format(folder, tmp_path, capfd):
    names = ["hills.tif", "N46W123.hgt", "hills.asc", "hills.dem", "hills.npy", "hills.npz",
             "hills.csv", "hills.zip"]  # fmt: skip
    paths = ",".join(str(folder / name) for name in names)
    assert main(["run", "-m", "terrain=file", f"terrain.path={paths}", "terrain.shape=[30,30]",
                 *ON_A_MAP, f"results_dir={tmp_path}"]) == 0  # fmt: skip
    # The DEM and its archive are one map and one run.
    assert "WARNING" not in capfd.readouterr().out
    maps = pd.read_parquet(tmp_path / "maps")
    truths = {run: table["truth"].to_numpy() for run, table in maps.groupby("run", observed=True)}
    assert len(truths) == len(names) - 1
    first, *others = truths.values()
    for other in others:
        assert np.corrcoef(first, other)[0, 1] > 0.98
    assert main(["audit", f"results_dir={tmp_path}", f"terrain.path={folder / 'hills.dem'}"]) == 0
    assert "truth within" in capfd.readouterr().out


def test_a_study_over_turned_maps_and_random_fields(tmp_path, capfd):
    for wanted in (
        ["terrain=volcano", "terrain.orientation=0,5"],
        ["terrain=random_field", "terrain.seed=1,2", "terrain.lengthscale=[9,4]"],
    ):
        assert main(["run", "-m", *wanted, *ON_A_MAP, f"results_dir={tmp_path}"]) == 0
    curves = pd.read_parquet(tmp_path / "curves")
    assert set(curves["terrain"]) == {
        "volcano", "volcano-turned5", "random_field-seed1", "random_field-seed2"
    }  # fmt: skip
    assert main(["audit", f"results_dir={tmp_path}"]) == 0
    assert capfd.readouterr().out.count("truth within") == 4


def test_show_takes_every_option_of_the_map(folder, tmp_path, capfd):
    command = ["terrain", "show", "terrain=file", f"terrain.path={folder / 'hills.dem'}",
               "terrain.shape=[30,20]", "terrain.crop=[0,20,5,-5]", "terrain.unit=ft",
               f"results_dir={tmp_path}"]  # fmt: skip
    assert main(command) == 0
    said = capfd.readouterr().out
    assert "file-hills-ft" in said
    assert "20 x 10" in said
    assert (tmp_path / "figures" / "terrain-file-hills-ft.png").is_file()
    assert main(["terrain", "show", "terrain=random_field", "terrain.seed=4",
                 f"results_dir={tmp_path}"]) == 0  # fmt: skip
    assert "random_field-seed4" in capfd.readouterr().out


def test_list_says_what_is_here(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("INFOPLAN_DATA", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["terrain", "list"]) == 0
    said = capfd.readouterr().out
    for name in ("helens", "volcano", "jacksboro", "random_field", "file", "own"):
        assert f"\n{name} " in f"\n{said}"
    assert "not here: infoplan terrain fetch" in said
    assert ".hgt" in said


BAD = {
    "terrain=volcano terrain.crop=[0,9,0,9]": "the chosen terrain has no option 'terrain.crop'",
    "terrain=volcano terrain.path=x.npy": "the chosen terrain has no option 'terrain.path'",
    "terrain=volcano terrain.options.height=3": "no option 'terrain.options'",
    "terrain=everest": "there is no terrain 'everest'",
    "terrain=volcano terrain.orientation=8": "at most 7",
    "terrain=volcano terrain.orientation=up": "terrain.orientation must be a whole number",
    "terrain=volcano terrain.orientaton=1": "did you mean 'terrain.orientation'",
    "terrain=volcano terrain.orientation=1 terrain.extent=[0,60,0,40]": "which would stretch",
    "terrain=volcano terrain.unit=miles": "terrain.unit=miles does not fit",
    "terrain=random_field terrain.lengthscale=[1]": "terrain.lengthscale=[1.0] must have 2",
    "terrain=random_field terrain.seed=-1": "terrain.seed=-1 is out of bounds",
    "terrain=file": "terrain=file needs terrain.path",
    "terrain=file terrain.path=nowhere.tif": "names no file that exists",
    "terrain=file terrain.path=hills.dem terrain.shape=[5]": "terrain.shape=[5] must have 2",
    "terrain=file terrain.path=hills.dem terrain.shape=[1,5]": "terrain.shape=[1, 5] is out of",
    "terrain=file terrain.path=hills.dem terrain.crop=[0,99,0,9]": "does not fit 41 rows",
    "terrain=file terrain.path=hills.dem terrain.nodata=keep": "use refuse or fill",
    "terrain=file terrain.path=cut.dem": "cut short",
    "terrain=file terrain.path=cut.tif": "cut short",
    "terrain=file terrain.path=cut.zip": "cannot be unpacked, it is damaged",
    "terrain=file terrain.path=out.zip": "leads out of it",
    "terrain=file terrain.path=magic.tif": "is not a readable GeoTIFF",
    "terrain=file terrain.path=thin.csv": "at least 2 rows and 2 columns",
    "terrain=file terrain.path=empty.csv": "holds no elevation at all",
    "terrain=file terrain.path=words.asc": "line 6, column 3: 'NA' is not a number",
    "terrain=file terrain.path=flat.asc": "cellsize 0: it must be above 0",
    "terrain=file terrain.path=points.csv": "looks like points x, y, z",
    "terrain=file terrain.path=wrong.csv": "line 4, column 3: 'x' is not a number",
    "terrain=file terrain.path=deep.csv": "beyond 1e+100",
    "terrain=file terrain.path=pipe.npy": "names a pipe, a socket or a device",
    "terrain=file terrain.path=hills.dem terrain.nodata=[1,2]": "terrain.nodata=[1, 2] is not",
    "terrain=file terrain.path=hills.dem terrain.nodata=true": "terrain.nodata=True is not",
    "terrain=file terrain.path=hills.dem terrain.nodata=nan": "terrain.nodata=nan must be finite",
    "terrain=volcano terrain.extent=[0,1e-9,0,1e-9]": "terrain.extent=[0.0, 1e-09, 0.0, 1e-09] is",
    "terrain=volcano terrain.extent=[0,1e308,0,1e308]": "[0.0, 1e+308, 0.0, 1e+308] is",
    "terrain=volcano terrain.extent=[-1e308,1e308,-1e308,1e308]": "1e+308, -1e+308, 1e+308] is",
}


@pytest.mark.parametrize("command", ["run", "terrain show"])
@pytest.mark.parametrize("arguments", BAD)
def test_a_mistake_is_one_sentence_and_status_2(
    command, arguments, folder, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    shutil.copy(folder / "hills.dem", tmp_path)
    for name in ("hills.dem", "hills.tif", "hills.zip"):
        content = (folder / name).read_bytes()
        Path(name.replace("hills", "cut")).write_bytes(content[: len(content) // 2])
    with zipfile.ZipFile("out.zip", "w") as out:
        out.writestr("../map.npy", b"")
    Path("magic.tif").write_bytes(b"PK\x03\x04" + bytes(99))
    Path("thin.csv").write_text("1,2,3\n")
    Path("empty.csv").write_text("nan,nan\nnan,nan\n")
    header = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    Path("words.asc").write_text(header + "1 NA\n3 4\n")
    Path("flat.asc").write_text(header.replace("cellsize 1", "cellsize 0") + "1 2\n3 4\n")
    Path("points.csv").write_text("".join(f"{x},{y},{x * y}\n" for x in range(9) for y in range(9)))
    Path("wrong.csv").write_text("# a map\n1,2\n\n3,x\n")
    Path("deep.csv").write_text("1,2\n-1.7e308,1.7e308\n")
    os.mkfifo("pipe.npy")
    assert main([*command.split(), *arguments.split()]) == 2
    said = capfd.readouterr()
    assert BAD[arguments] in said.err
    assert len(said.err.splitlines()) == 1
    assert said.out == ""


def test_a_picture_that_cannot_be_written_is_one_sentence(tmp_path, monkeypatch, capfd):
    (tmp_path / "figures").touch()
    show = ["terrain", "show", "terrain=volcano"]
    assert main([*show, f"results_dir={tmp_path / 'figures'}"]) == 2
    assert "is a file: name a folder" in capfd.readouterr().err
    assert main([*show, f"results_dir={tmp_path}"]) == 1
    said = capfd.readouterr().err
    assert "could not be written (File exists)" in said
    assert "move what is in the way elsewhere or name another results_dir" in said
    # As on a full disk: files end at 1000 bytes.
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        status = main([*show, f"results_dir={tmp_path / 'results'}"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert status == 1
    said = capfd.readouterr().err
    assert "File too large): make room or name another results_dir" in said
    assert len(said.splitlines()) == 1


def test_a_marked_map_is_one_run_however_its_mark_is_written(folder, tmp_path, capfd):
    elevation = np.load(folder / "hills.npy").astype(float)
    elevation[3, 4] = -9999
    np.save(tmp_path / "void.npy", elevation)
    wanted = ["terrain=file", f"terrain.path={tmp_path / 'void.npy'}", *ON_A_MAP,
              f"results_dir={tmp_path}"]  # fmt: skip
    assert main(["run", *wanted]) == 0
    assert "WARNING: an elevation of" in capfd.readouterr().out
    for number in ("-9999", "-9999.0", "-9.999e3"):
        assert main(["run", *wanted, f"terrain.nodata={number}"]) == 0
    assert "WARNING" not in capfd.readouterr().out
    assert len(list((tmp_path / "runs").iterdir())) == 2
    assert main(["audit", f"results_dir={tmp_path}", f"terrain.path={tmp_path / 'void.npy'}"]) == 0
