"""Missions from several machines or libraries in one study are told, once."""

import copy
import json

import pyarrow.parquet as pq
import pytest
from studies import quick, study

from infoplan.study.executor import differences
from infoplan.study.provenance import provenance
from infoplan.study.store import sealed
from infoplan.threads import look_again, one_thread


def test_provenance_tells_the_threads_of_now():
    assert provenance()["blas"]
    look_again()
    with one_thread():
        assert {blas["num_threads"] for blas in provenance()["blas"]} == {1}


def test_differences_name_what_decides_the_last_digits():
    here = provenance()
    assert differences(here, copy.deepcopy(here)) == []
    there = copy.deepcopy(here)
    there["cpu"] = "another"
    there["libraries"]["scipy"] = "0.0"
    there["libraries"]["rich"] = "0.0"
    there["platform"] = "another"
    assert differences(here, there) == ["cpu", "scipy"]
    assert differences({}, here)


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_resume_across_machines_warns_once(elsewhere, tmp_path):
    study(quick(), tmp_path, seeds=2, backend="sequential")
    if elsewhere:
        for path in tmp_path.rglob("seed=*.parquet"):
            table = pq.read_table(path, partitioning=None)
            footer = json.loads(table.schema.metadata[b"infoplan"])
            metadata = {b"infoplan": sealed({**footer, "cpu": "a Cray-1"})}
            pq.write_table(table.replace_schema_metadata(metadata), path)
    done, said = study(quick(), tmp_path, seeds=4, backend="sequential")
    assert (done.kept, done.computed) == (2, 2)
    assert said.count("were computed elsewhere (other cpu)") == int(elsewhere)
    _, said = study(quick(), tmp_path, seeds=4, backend="sequential")
    assert "elsewhere" not in said
