"""Terrains in the run's identity: what counts, what comes back, which map is found again."""

from dataclasses import asdict, replace

import numpy as np
import pytest
import yaml

from infoplan.config import (
    TERRAIN_SCHEMAS,
    Config,
    FileConfig,
    HelensConfig,
    MissionConfig,
    OwnTerrainConfig,
    RandomFieldConfig,
    TerrainConfig,
)
from infoplan.errors import UsageError
from infoplan.study.identity import config_from_science, identify, run_name
from infoplan.study.stored_terrains import stored_terrains
from infoplan.terrain import load_terrain

OWN = "def hill(*, height: float = 3):\n    return [[0, height], [1, 2]]\n"


@pytest.fixture
def maps(tmp_path, monkeypatch):
    """A folder with a map in a file and a module with a function."""
    np.save(tmp_path / "hills.npy", np.arange(30.0).reshape(5, 6))
    (tmp_path / "some_hills.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


TERRAINS = [
    TerrainConfig("volcano"),
    TerrainConfig("volcano", unit="m", orientation=5),
    TerrainConfig("jacksboro", extent=[0.0, 60.0, 0.0, 40.0], orientation=4),
    RandomFieldConfig(seed=3, shape=[9, 9], unit="ft"),
    FileConfig(path="hills.npy"),
    FileConfig(path="hills.npy", shape=[4, 4], crop=[0, 4, 1, 4], unit="feet", orientation=2),
    OwnTerrainConfig(function="some_hills.hill", options={"height": 7}),
]


def science_of(config: TerrainConfig) -> dict:
    return identify(replace(Config(), terrain=config), load_terrain(**vars(config))).science


@pytest.mark.parametrize("terrain", TERRAINS, ids=lambda terrain: terrain.name)
def test_a_stored_terrain_comes_back_and_is_the_same_map(terrain, maps):
    loaded = load_terrain(**vars(terrain))
    run = identify(replace(Config(), terrain=terrain), loaded)
    restored = config_from_science(yaml.safe_load(yaml.safe_dump(run.science)))
    assert type(restored) is MissionConfig
    assert type(restored.terrain) is type(terrain)
    assert replace(restored.terrain, name=terrain.name).orientation == terrain.orientation
    options = vars(restored.terrain)
    if isinstance(terrain, FileConfig):
        options["path"] = "hills.npy"
    again = load_terrain(**options)
    assert (again.name, again.unit, again.sha256) == (loaded.name, loaded.unit, loaded.sha256)
    np.testing.assert_array_equal(again.elevation, loaded.elevation)
    assert identify(replace(Config(), terrain=restored.terrain), again).name == run.name


def test_every_option_of_every_terrain_is_science_but_where_it_is_found():
    left_out = {
        (kind, name)
        for kind, schema in TERRAIN_SCHEMAS.items()
        for name, item in schema.__dataclass_fields__.items()
        if not item.metadata["science"]
    }
    masks = {(kind, "obstacles_mask") for kind in TERRAIN_SCHEMAS}  # kept as terrain.obstacles
    assert left_out == masks | {
        ("helens", "path"), ("helens", "on_missing"), ("file", "path"), ("file", "member")
    }  # fmt: skip


def test_where_a_map_is_found_does_not_count(maps, tmp_path):
    (tmp_path / "other").mkdir()
    copy = tmp_path / "other" / "hills.npy"
    copy.write_bytes((maps / "hills.npy").read_bytes())
    one, other = science_of(FileConfig(path="hills.npy")), science_of(FileConfig(path=str(copy)))
    assert one == other
    assert "path" not in one["terrain"]


def test_options_of_an_own_function_are_stored_with_their_defaults(maps):
    config = OwnTerrainConfig(function="some_hills.hill")
    stored = science_of(config)["terrain"]
    assert stored["options"] == {"height": 3.0}
    assert science_of(replace(config, options={"height": 3}))["terrain"] == stored
    assert config.options == {}


def test_a_replaced_helens_is_volcano_in_every_respect(volcano):
    replaced = identify(replace(Config(), terrain=HelensConfig()), volcano)
    chosen = identify(replace(Config(), terrain=TerrainConfig("volcano")), volcano)
    assert replaced.name == chosen.name
    assert asdict(replaced.config) == asdict(chosen.config)


class TestFoundAgain:
    @pytest.fixture
    def results(self, maps):
        folder = maps / "results" / "runs"
        folder.mkdir(parents=True)
        for terrain in TERRAINS:
            science = science_of(terrain)
            (folder / f"{run_name(science)}.yaml").write_text(yaml.safe_dump(science))
        return folder.parent

    def test_all_but_files_without_their_path_and_functions(self, results):
        found = {terrain.name for terrain in stored_terrains(results)}
        assert found == {"volcano", "volcano-m-turned5", "jacksboro-turned4",
                         "random_field-seed3"}  # fmt: skip

    def test_files_as_they_were_changed(self, results):
        found = [item for item in stored_terrains(results, "hills.npy") if "file" in item.name]
        assert {terrain.name for terrain in found} == {"file-hills", "file-hills-turned2"}
        assert {terrain.elevation.shape for terrain in found} == {(5, 6), (4, 3)}

    def test_a_file_that_is_no_run_s(self, results, tmp_path):
        with pytest.raises(UsageError, match=r"terrain\.path=nowhere\.npy leads to the map of no"):
            stored_terrains(results, "nowhere.npy")
        np.save(tmp_path / "others.npy", np.arange(30.0).reshape(6, 5))
        with pytest.raises(UsageError, match=r"leads to the map of no run"):
            stored_terrains(results, "others.npy")

    def test_configurations_that_cannot_be_read_are_passed_over(self, results):
        for number, text in enumerate(["", "[", "{}", "terrain: 3", "terrain: {name: everest}"]):
            (results / "runs" / f"bad{number}.yaml").write_text(text)
        assert len(stored_terrains(results)) == 4
