"""What ``infoplan survey`` does: read logs, judge and map them, write what one takes away."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from infoplan.analyse.detector_check import check_detectors
from infoplan.analyse.later_logs import read_origins
from infoplan.analyse.relief import on_grid
from infoplan.draw.console import say, wide_console
from infoplan.draw.progress import listener
from infoplan.draw.survey_page import write_survey_page
from infoplan.draw.survey_picture import draw_survey
from infoplan.draw.survey_table import print_check, print_survey
from infoplan.hydra_front.reconfigure import SURVEY, names_opened, reconfigure
from infoplan.study.store import read_table
from infoplan.study.study import Study
from infoplan.study.surveys import SEED, survey_config, survey_samples, survey_study
from infoplan.survey import SurveyLog, read_logs
from infoplan.survey.clean import write_clean
from infoplan.survey.geotiff import write_geotiff
from infoplan.text_options import as_command


def survey(
    results_dir: Path,
    paths: Sequence[Path],
    columns: Mapping[str, str] | None,
    crs: str | None,
    unit: str | None,
    batch: str | None,
    check: float | None,
    overrides: Sequence[str],
) -> int:
    """Run ``infoplan survey``.

    Parameters
    ----------
    results_dir
        The folder of the tables; what one takes away lands in its ``surveys/<run>``.
    paths, columns, crs, unit
        As of `read_logs`.
    batch
        As of `infoplan.study.surveys.batches`.
    check
        As the share of `check_detectors`; None: no check.
    overrides
        As of `reconfigure`.

    Returns
    -------
    int
        1 if it has failed, else 0.
    """
    console = wide_console()
    listening = listener(console)
    names_opened(overrides, SURVEY)  # what is not open is told before the log is read
    log = read_logs(paths, columns, crs, unit)
    for one in log.parts or (log,):
        listening.say(
            f"{one.name}: {len(one)} samples from {len(one.columns)} rows, "
            f"{one.roles['value']} in {one.unit or 'no known unit'}, {one.crs or 'metres'}", "note",
        )  # fmt: skip
        for remark in one.remarks:
            listening.say(f"{one.name}: {remark}" if log.parts else remark, "note")
    for remark in log.remarks if log.parts else ():
        listening.say(remark, "note")
    config = reconfigure(survey_config(log, batch), overrides, SURVEY)
    config.results_dir = str(results_dir)
    study = survey_study(log, config, listening)
    if study.failed:
        return 1
    folder = study.results_dir / "surveys" / study.runs[0][0].name
    print_survey(study, console, folder, _written(study, log, folder))
    if check is not None:
        checked = check_detectors(survey_samples(log, config), config, check)
        print_check(checked, log.unit, console)
    onwards = f"infoplan next {study.runs[0][0].name} budget=200"
    say(console, f"plan the next track of 200 m: {as_command(onwards, study.results_dir)}")
    return 0


def _written(study: Study, log: SurveyLog, folder: Path) -> list[str]:
    """Write the files of a survey; returns a line on each."""
    run, _ = study.runs[0]
    samples, maps = (
        read_table(study.results_dir, name, run.name, SEED).to_pandas()
        for name in ("samples", "maps")
    )
    origins = read_origins(study.results_dir, run.name, SEED)
    if origins is not None:
        samples["log"] = origins["log"]
    clean = []
    for number, one in enumerate(log.parts or (log,)):
        mine = log.log_of == number
        clean.append(
            write_clean(
                folder / (f"clean-{one.name}.csv" if log.parts else "clean.csv"), one,
                samples["score"].to_numpy()[mine], samples["flagged"].to_numpy()[mine],
                run.science["detector"],
                None if origins is None else origins["verdict"][mine].fillna("").tolist(),
            )
        )  # fmt: skip
    place = run.config.terrain
    bands = {
        "mean": (on_grid(maps, "mean"), log.unit),
        "deviation": (on_grid(maps, "std"), log.unit),
        "outlier density": (on_grid(maps, "outlier_density"), "flagged samples"),
    }
    tiff = write_geotiff(folder / "map.tif", bands, place.extent, place.origin, log.crs)
    picture = draw_survey(samples, maps, folder, log.name, log.unit)[0]
    return [
        *(f"{path.name}: all rows, with score, flagged and why" for path in clean),
        tiff,
        f"{picture.name}: track, flags, mean, deviation",
        write_survey_page(folder / "page.html", study, log),
    ]
