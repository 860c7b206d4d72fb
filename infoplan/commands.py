"""All commands of the command line: each is declared here, once, beside the function it calls.

A declaration gives the command's line of help, its options with type, default and unit, its flags,
what it takes besides, and examples. Functions import what they need when they are called: help and
completion stay quick.
"""

import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from infoplan.command_line.command import Command, Group
from infoplan.command_line.pages import page_width
from infoplan.command_line.settings import GIVEN, Function, hydra_flag, setting
from infoplan.command_line.types import Number, Text, UserPath
from infoplan.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from infoplan.analyse.tables import Selection
    from infoplan.command_line.settings import More

FIGURES = ("fig1", "fig3", "fig4", "fig5", "fig6", "fig7", "calibration", "outliers", "explain")

INFO = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")

EXIT_OK, EXIT_FAILED = 0, 1


class RunName(click.ParamType):
    """A stored run: its name, its hash, or the beginning of either.

    Parameters
    ----------
    several
        Whether a list of runs will do.
    """

    name, words = "run", "a run's name, its hash, or the beginning of either"

    def __init__(self, several: bool = False) -> None:
        self.several = several

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Take it as typed, several in brackets; nothing at all chooses nothing."""
        if not isinstance(value, str):
            return value
        if value.startswith("[") and value.endswith("]"):
            if not self.several:
                raise UsageError(
                    f"{param.word}={value} is a list, where one run is taken: {self.words}"
                )
            return [entry.strip() for entry in value[1:-1].split(",")]
        return value or None

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer what is stored in the results folder that the line names."""
        from infoplan.files import user_path
        from infoplan.study.run_names import stored_runs

        runs = stored_runs(user_path(ctx.meta[GIVEN].get("results_dir", "results")))
        names = [CompletionItem(run) for run in runs if run.startswith(incomplete)]
        hashes = [(run.rpartition("-")[2], run) for run in runs]
        return names + [
            CompletionItem(end, help=run) for end, run in hashes if end.startswith(incomplete)
        ]


class FigureName(click.ParamType):
    """A figure that is drawn from stored results."""

    name, words = "figure", f"{', '.join(FIGURES[:-1])} or {FIGURES[-1]}"

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer the figures."""
        return [CompletionItem(name) for name in FIGURES if name.startswith(incomplete)]


class Seeds(click.ParamType):
    """A number of seeds, or a list of them."""

    name, words = "seeds", "a count n (0 to n - 1), or a list like [0,3]"

    def convert(self, value: Any, param: Any, ctx: Any) -> Sequence[int]:
        """Read them."""
        import yaml

        from infoplan.config import seed_list

        try:
            read = yaml.safe_load(value) if isinstance(value, str) else value
        except yaml.YAMLError:
            read = value
        return seed_list(read)


class Epochs(click.ParamType):
    """Which epochs of a mission."""

    name, words = "epochs", "all, a number of epochs, or a list like [0,5,9]"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Read them."""
        import yaml

        try:
            return yaml.safe_load(value) if isinstance(value, str) else value
        except yaml.YAMLError:
            return value


RESULTS = setting("results_dir", UserPath(folder=True), "folder of the tables", default="results")


TRUST = setting(
    "trust", click.BOOL, "import the functions of its own that the stored run names", default=False
)


def latex_flag(function: Function) -> Function:
    """Declare the flag of commands whose tables go into papers."""
    doc = "write the table for LaTeX, with booktabs"
    return click.option("--latex", "as_latex", is_flag=True, help=doc)(function)


def _console_of(as_latex: bool) -> "Console":
    from infoplan.draw.console import wide_console
    from infoplan.draw.latex import LatexConsole

    return LatexConsole() if as_latex else wide_console()


def options_of(what: str) -> "Callable[[], More]":
    """Declare which options of configurations a command takes, read when they are needed."""

    def load() -> "More":
        from infoplan import run_options

        found: More = getattr(run_options, what)
        return found

    return load


def run_setting(doc: str) -> Any:
    """Declare which run a command is about: ``run=`` or a word alone."""
    return setting("run", RunName(), doc, bare=1)


def completion_flag(hidden: bool = False) -> Any:
    """Declare the flag that shells and their users ask for completion with."""
    return click.option(
        "-sc", "--shell-completion", metavar="install=SHELL", expose_value=False, is_eager=True,
        hidden=hidden, callback=lambda ctx, _, text: _complete(ctx, text),
        help="completion in bash, zsh or fish: eval \"$(infoplan -sc install=bash)\"; also "
             "uninstall=",
    )  # fmt: skip


def config_flags(function: Any) -> Any:
    """Declare Hydra's flags that say where configurations are found."""
    for names, doc, kind in (
        (("-cd", "--config-dir"), "a further folder of configurations", UserPath(folder=True)),
        (("-cn", "--config-name"), "another root configuration", click.STRING),
        (("-cp", "--config-path"), "another package of configurations", click.STRING),
    ):
        function = hydra_flag(*names, help=doc, type=kind)(function)
    return function


@click.group(
    "infoplan", cls=Group, invoke_without_command=False,
    help="Informative planning in the presence of outliers.",
    examples=["infoplan run planner=puct detector=copod rho=0.1",
              "infoplan run -m planner=uct,puct rho=0.05,0.1", "infoplan help run"],
)  # fmt: skip
@completion_flag()
@click.option("--version", is_flag=True, expose_value=False, is_eager=True,
              callback=lambda ctx, _, asked: _version(ctx, asked),
              help="tell the version")  # fmt: skip
def infoplan() -> None:
    """Hold the commands."""


def command_on_runs(name: str, **attributes: Any) -> Callable[[Function], click.Command]:
    """Declare a command about stored runs, which any option of a run chooses."""

    def declare(function: Function) -> click.Command:
        one_or_more = RunName(several=True)
        chosen = setting("run", one_or_more, "one run, or a list of them, alone")(function)
        command = infoplan.command(name, cls=Command, more=options_of("FILTERS"), **attributes)
        return command(RESULTS(chosen))

    return declare


@infoplan.command(
    "demo", cls=Command,
    help="Take a tour of a minute: a small study, from mission to report, and its commands.",
    examples=["infoplan demo", "infoplan demo results_dir=tour budget=200 --no-open"],
)  # fmt: skip
@setting("results_dir", UserPath(folder=True), "folder of all that it makes",
         default="infoplan-demo")  # fmt: skip
@setting("budget", click.IntRange(min=1), "samples of a mission", default=300)
@setting("seeds", click.IntRange(min=1), "missions of each method", default=2)
@setting("backend", click.Choice(["loky", "sequential"]), "worker processes, or one mission after "
         "the other in this one", default="loky")  # fmt: skip
@click.option("--no-open", "unopened", is_flag=True, help="leave the browser alone")
def demo(results_dir: Path, budget: int, seeds: int, backend: str, unopened: bool) -> int:
    """Take the tour."""
    from infoplan.demo_command import demo

    return demo(results_dir, budget, seeds, backend, not unopened, call)


@infoplan.command(
    "run", cls=Command, more=options_of("RUN"),
    help="Run one configuration with all its seeds, or with -m every combination of values.",
    examples=["infoplan run planner=puct detector=copod rho=0.1",
              "infoplan run -m planner=uct,puct rho=0.05,0.1",
              "infoplan run -m experiment=fig5 --dry-run"],
)  # fmt: skip
@hydra_flag("-m", "--multirun", is_flag=True, help="run every combination of values")
@hydra_flag("--dry-run", is_flag=True, help="list what would run, and about how long it takes")
@hydra_flag("-c", "--cfg", type=click.Choice(["job", "hydra", "all"]),
            help="show the configuration instead of running it")  # fmt: skip
@hydra_flag("--resolve", is_flag=True, help="with --cfg: resolve references")
@hydra_flag("-p", "--package", help="with --cfg: show this part alone")
@hydra_flag("-i", "--info", optional=INFO, help="tell about the configuration's sources")
@hydra_flag("-r", "--run", is_flag=True, help="run one configuration, as without -m")
@config_flags
@hydra_flag("--experimental-rerun", type=UserPath(), help="Hydra's: run what a pickle file holds")
@hydra_flag("--version", is_flag=True, help="tell Hydra's version")
@hydra_flag("--hydra-help", is_flag=True, help="tell about Hydra")
@completion_flag(hidden=True)
def run(overrides: list[str]) -> int:
    """Run a study."""
    from infoplan.study_commands import run

    # Hydra's page about itself composes nothing, and would stumble over overrides.
    return run(["--hydra-help"] if "--hydra-help" in overrides else overrides)


@infoplan.command(
    "replay", cls=Command, more=options_of("REPLAY"),
    help="Put a stored run's samples through another detector or model.",
    examples=["infoplan replay puct-none-helens detector=best seeds=2"],
)  # fmt: skip
@run_setting("which run's samples")
@RESULTS
@setting("seeds", Seeds(), "which seeds; all that are done if left out")
@TRUST
def replay(
    run: str | None,
    results_dir: Path,
    seeds: Sequence[int] | None,
    trust: bool,
    overrides: list[str],
) -> int:
    """Replay a run."""
    from infoplan.study_commands import replay

    if not isinstance(run, str):
        from infoplan.text_options import as_command

        raise UsageError(
            "infoplan replay takes one stored run: give its name or its hash, which "
            f"{as_command('infoplan status', results_dir)} lists, and detector=best or "
            "the like"
        )
    return replay(results_dir, run, seeds, trust, overrides)


class Mapping(click.ParamType):
    """Names by names, as YAML writes them between braces."""

    name, words = "mapping", "a mapping like {value: Depth, time: UTC}"

    def convert(self, value: Any, param: Any, ctx: Any) -> dict[str, str]:
        """Read it."""
        import yaml

        try:
            read = yaml.safe_load(value) if isinstance(value, str) else value
        except yaml.YAMLError:
            read = None
        if not isinstance(read, dict):
            self.fail(f"{value} is no mapping", param, ctx)
        return {str(name): str(entry) for name, entry in read.items()}


@infoplan.command(
    "survey", cls=Command, more=options_of("SURVEY"),
    help="Judge and map the log of a real survey: spikes out, a map with its uncertainty.",
    examples=["infoplan survey track.csv", "infoplan survey track.gpx detector=local batch=30s",
              "infoplan survey may.csv june.csv",
              "infoplan survey 'log.csv' 'columns={x: East, y: North, value: D}' crs=EPSG:32619"],
)  # fmt: skip
@setting("log", UserPath(), "the log: .csv, .tsv, .txt, .gpx, .nc or .parquet; or several of one "
         "place", default=(), bare=-1, named=False)  # fmt: skip
@RESULTS
@setting("columns", Mapping(), "names of its columns by what they are (lat, lon, x, y, value, "
         "time, date), where they are not recognised")  # fmt: skip
@setting("crs", Text(), "the plane in metres, as EPSG:32619; the local UTM zone if left out")
@setting("unit", Text(), "of the values; as the log says if left out")
@setting("batch", Text(), "judge so many samples at a time, or seconds as in 30s, or each log; "
         "at once, and of several logs each, if left out")  # fmt: skip
@setting("check", Number(min=0, max=0.5, min_open=True), "compare all detectors: so large a share "
         "of the samples of a copy become known spikes")  # fmt: skip
def survey(
    log: tuple[Path, ...],
    results_dir: Path,
    columns: dict[str, str] | None,
    crs: str | None,
    unit: str | None,
    batch: str | None,
    check: float | None,
    overrides: list[str],
) -> int:
    """Map a survey."""
    from infoplan.survey_command import survey

    if not log:
        raise UsageError(
            "infoplan survey takes the log of a survey: name the file, like infoplan survey "
            "track.csv"
        )
    return survey(results_dir, log, columns, crs, unit, batch, check, overrides)


@infoplan.command(
    "next", cls=Command, more=options_of("AHEAD"),
    help="Plan where to go after a survey: a track as CSV, GPX, GeoJSON and mission.",
    examples=["infoplan next survey-track budget=500",
              "infoplan next 1a2b3c4d budget=2000 inside=bay.geojson turning_radius=3 speed=2",
              "infoplan next 1a2b3c4d budget=500 from=44.39,-68.21 heading=90"],
)  # fmt: skip
@run_setting("which survey, as infoplan status lists them")
@RESULTS
@setting("budget", Number(min=0, min_open=True), "length of the track", unit="m")
@setting("from", Text(), "where it starts, LAT,LON or metres; where the survey ended if left out")
@setting("heading", Number(min=-360, max=360), "with which heading, clockwise from north; as the "
         "survey ended, or any other, if left out", unit="degrees")  # fmt: skip
@setting("inside", Text(), "polygon that it stays in: GeoJSON file, or [[LAT,LON],...]; the hull "
         "of the survey's track if left out")  # fmt: skip
@setting("avoid", Text(), "no-go zones: GeoJSON file, or a list of such polygons")
@setting("turning_radius", Number(min=0, min_open=True), "of the vehicle; the track turns no "
         "tighter", unit="m", default=5.0)  # fmt: skip
@setting("speed", Number(min=0, min_open=True), "of the vehicle", unit="m/s", default=1.5)
@setting("step", Number(min=0, min_open=True), "distance of two samples; as in the survey if left "
         "out", unit="m")  # fmt: skip
@setting("plans", click.IntRange(min=1, max=1000), "of so many plans at a time the best is driven",
         default=8)  # fmt: skip
@setting("altitude", Number(), "of the mission's waypoints above home", unit="m", default=0.0)
@TRUST
def plan_next(
    run: str | None,
    results_dir: Path,
    budget: float | None,
    from_: str | None,
    heading: float | None,
    inside: str | None,
    avoid: str | None,
    turning_radius: float,
    speed: float,
    step: float | None,
    plans: int,
    altitude: float,
    trust: bool,
    overrides: list[str],
) -> int:
    """Plan a track after a survey."""
    from infoplan.next_command import Trip, plan_next

    if not isinstance(run, str) or budget is None:
        from infoplan.text_options import as_command

        raise UsageError(
            "infoplan next takes one stored survey, by its name or its hash, which "
            f"{as_command('infoplan status', results_dir)} lists, and the length of the track in "
            "metres, like budget=500"
        )
    trip = Trip(budget, from_, heading, inside, avoid, turning_radius, speed, step, plans, altitude)
    return plan_next(results_dir, run, trip, trust, overrides)


@infoplan.command(
    "status", cls=Command, more=options_of("STATUS"),
    help="What is done, failed and missing, of all stored runs or of a study.",
    examples=["infoplan status", "infoplan status experiment=fig5 seeds=20"],
)  # fmt: skip
@run_setting("one stored run; without it, all of them, or the study that the options describe")
@RESULTS
@click.option("--json", "as_json", is_flag=True, help="write it for scripts")
@hydra_flag("-m", "--multirun", is_flag=True,
            help="a study of all values: a status always is")  # fmt: skip
@config_flags
@click.pass_context
def status(
    ctx: click.Context, run: str | None, results_dir: Path, as_json: bool, overrides: list[str]
) -> int:
    """Look at a results folder."""
    from infoplan.study_commands import status

    study = [word for word in overrides if word not in ("-m", "--multirun")]
    if study and "results_dir" in ctx.meta[GIVEN]:
        study.append(f"results_dir={ctx.meta[GIVEN]['results_dir']}")
    return status(results_dir, study, run, as_json)


@command_on_runs(
    "figures",
    help="Draw figures from stored results: the paper's, calibration, faults, sources of error.",
    examples=["infoplan figures fig5 fig7 seed=1", "infoplan figures outliers rho=0.2"],
)  # fmt: skip
@setting("figure", FigureName(), "which; all if none is named", default=(), bare=-1,
         named=False)  # fmt: skip
@setting("seed", click.IntRange(min=0), "the mission whose maps are shown", default=0)
@click.option("--seeds", is_flag=True, help="Fig. 5 shows each seed as a thin line")
def figures(
    figure: tuple[str, ...],
    results_dir: Path,
    run: str | list[str] | None,
    seed: int,
    seeds: bool,
    filters: dict[str, Any],
) -> int:
    """Draw figures."""
    from infoplan.analyse.mission_scores import stored_faults
    from infoplan.draw.figures import (
        EXPLAIN,
        OF_STUDY,
        OUTLIERS,
        check_names,
        draw_explain,
        draw_figures,
        draw_outliers,
    )

    names = check_names(figure)
    problems: list[str] = []
    drawn = []
    if of_study := [name for name in names if name in OF_STUDY]:
        study = _study(results_dir, run, filters)
        problems += study.notes
        drawn += draw_figures(study, of_study, seed=seed, single_seeds=seeds)
    if OUTLIERS in names:
        chosen = _with_runs(results_dir, run, filters)
        if figure or ("replay" not in filters and len(stored_faults(results_dir, chosen)) > 1):
            heat_map, notes = draw_outliers(results_dir, chosen)
            problems += notes
            drawn.append(heat_map)
    if EXPLAIN in names:
        explanation = draw_explain(_study(results_dir, run, filters))
        if figure or explanation.files:
            drawn.append(explanation)
    for one in drawn:
        for path in one.files:
            print(path)
        problems += [one.problem] if one.problem else []
    for problem in problems:
        print(problem, file=sys.stderr)
    return EXIT_FAILED if any(one.problem for one in drawn) else EXIT_OK


@command_on_runs(
    "claims",
    help="Judge the paper's claims by stored results.",
    examples=["infoplan claims terrain=helens --markdown"],
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="write them for scripts")
@click.option("--markdown", "as_markdown", is_flag=True, help="write them for documents")
@click.option("--csv", "as_csv", is_flag=True, help="write what is compared, seed by seed")
@latex_flag
def claims(
    results_dir: Path,
    run: str | list[str] | None,
    as_json: bool,
    as_markdown: bool,
    as_csv: bool,
    as_latex: bool,
    filters: dict[str, Any],
) -> int:
    """Judge the claims."""
    from infoplan.analyse.claims import judge_claims
    from infoplan.draw.claims_table import as_csv as to_csv
    from infoplan.draw.claims_table import as_json as to_json
    from infoplan.draw.claims_table import markdown, print_claims

    if as_json + as_markdown + as_csv + as_latex > 1:
        raise UsageError("claims are written as --json, --markdown, --csv or --latex: choose one")
    study = _study(results_dir, run, filters)
    judged = judge_claims(study)
    if as_json:
        print(to_json(judged, study))
    elif as_csv:
        print(to_csv(judged))
    elif as_markdown:
        print(markdown(judged, study))
    else:
        print_claims(judged, study, _console_of(as_latex))
    return EXIT_OK


@command_on_runs(
    "multiverse",
    help="What the paper's claims hang on: each in every reading of what the paper leaves open.",
    examples=["infoplan multiverse model.name=vecchia", "infoplan multiverse 'universe=joint 7'",
              "infoplan multiverse table=results/multiverse.parquet"],
)  # fmt: skip
@setting("table", UserPath(), "numbers that an earlier call has written; worked out anew from "
         "the results, and written there, if left out")  # fmt: skip
@setting("universe", Text(), "tell about one alone, and how to fly it")
@setting("claim", Text(), "tell what moves one claim, as C4, and draw the choices below its curve")
@click.option("--list", "listed", is_flag=True, help="name all universes, flown or not")
@click.option("--json", "as_json", is_flag=True, help="write how all claims fare for scripts")
@click.option("--markdown", "as_markdown", is_flag=True, help="write that, and what every level "
              "does, for documents")  # fmt: skip
@latex_flag
def multiverse(
    results_dir: Path,
    run: str | list[str] | None,
    table: Path | None,
    universe: str | None,
    claim: str | None,
    listed: bool,
    as_json: bool,
    as_markdown: bool,
    as_latex: bool,
    filters: dict[str, Any],
) -> int:
    """Sum up the multiverse."""
    from infoplan.multiverse_command import list_universes, multiverse

    if as_json + as_markdown + as_latex > 1:
        raise UsageError("the multiverse is written as --json, --markdown or --latex: choose one")
    if listed:
        given = {"table": table, "universe": universe, "claim": claim, "run": run, **filters}
        others = [f"{name}=" for name, value in given.items() if value is not None]
        flags = {"--json": as_json, "--markdown": as_markdown, "--latex": as_latex}
        others += [flag for flag, asked in flags.items() if asked]
        if others:
            raise UsageError(
                f"--list names all universes, flown or not: leave {', '.join(others)} out"
            )
        return list_universes(_console_of(False))
    return multiverse(
        results_dir,
        table,
        universe,
        claim,
        {"run": run, **_wanted(results_dir, filters)},
        _console_of(as_latex),
        as_json,
        as_markdown,
    )


@command_on_runs(
    "report",
    help="Write curves, claims and maps as one HTML page.",
    examples=["infoplan report terrain=volcano"],
)  # fmt: skip
def report(results_dir: Path, run: str | list[str] | None, filters: dict[str, Any]) -> int:
    """Write the report."""
    from infoplan.analyse.tables import find_missions
    from infoplan.draw.report import write_report

    missions = find_missions(results_dir, run=run, **_wanted(results_dir, filters))
    print(f"reported to {write_report(missions)}")
    return EXIT_OK


@infoplan.command(
    "show", cls=Command,
    help="Show one stored run: curve, detector, time.",
    examples=["infoplan show puct-copod-helens"],
)  # fmt: skip
@run_setting("which run; the only one if left out")
@RESULTS
def show(run: str | None, results_dir: Path) -> int:
    """Show a run."""
    from infoplan.analyse.tables import find_missions
    from infoplan.draw.console import wide_console
    from infoplan.draw.show import show

    show(find_missions(results_dir, run=run), wide_console())
    return EXIT_OK


@infoplan.command(
    "explain", cls=Command, more=options_of("EXPLAIN"),
    help="Say where a run's error comes from: learning, spikes, samples lost, places.",
    examples=["infoplan explain uct-copod-helens seeds=6 --seeds"],
)  # fmt: skip
@run_setting("which run, or a list of runs")
@RESULTS
@setting("best", RunName(), "the run of detector=best to compare with; that of UCT with the same "
         "options if left out")  # fmt: skip
@setting("seeds", Seeds(), "which seeds; all that both have if left out")
@click.option("--seeds", "single_seeds", is_flag=True, help="print each seed, too")
@click.option("--csv", "as_csv", is_flag=True, help="write every seed for scripts")
@click.option("--json", "as_json", is_flag=True, help="write means and seeds for scripts")
@latex_flag
def explain(
    run: str | list[str] | None,
    results_dir: Path,
    best: str | None,
    seeds: Sequence[int] | None,
    single_seeds: bool,
    as_csv: bool,
    as_json: bool,
    as_latex: bool,
    overrides: list[str],
) -> int:
    """Explain runs."""
    from rich.console import Console

    from infoplan.draw.explain_table import as_csv as to_csv
    from infoplan.draw.explain_table import as_json as to_json
    from infoplan.draw.explain_table import print_sources
    from infoplan.study_commands import explain

    if as_csv + as_json + as_latex > 1:
        raise UsageError("explanations are written as --json, --csv or --latex: choose one")
    if run is None:
        from infoplan.text_options import as_command

        raise UsageError(
            "infoplan explain takes one stored run, or a list of them: give the name or the hash, "
            f"which {as_command('infoplan status', results_dir)} lists"
        )
    named = [run] if isinstance(run, str) else run
    console = _console_of(as_latex)
    told = Console(stderr=True) if as_csv or as_json or as_latex else console
    sources, failed = explain(results_dir, named, best, seeds, overrides, told)
    if sources and as_json:
        print(to_json(sources))
    elif sources and as_csv:
        print(to_csv(sources))
    elif sources:
        print_sources(sources, console, single_seeds=single_seeds)
    return EXIT_FAILED if failed else EXIT_OK


@infoplan.command(
    "leaderboard", cls=Command, more=options_of("LEADERBOARD"),
    help="Rank methods over maps and outlier shares.",
    examples=["infoplan leaderboard terrain=[volcano,jacksboro] --markdown"],
)  # fmt: skip
@RESULTS
@setting("run", RunName(several=True), "a list of runs, alone")
@click.option("--markdown", "as_markdown", is_flag=True, help="write it for documents")
@click.option("--html", "as_html", is_flag=True, help="write a page, leaderboard.html")
@latex_flag
def leaderboard(
    results_dir: Path,
    run: str | list[str] | None,
    as_markdown: bool,
    as_html: bool,
    as_latex: bool,
    filters: dict[str, Any],
) -> int:
    """Rank the methods."""
    from infoplan.analyse.leaderboard import rank
    from infoplan.draw.leaderboard_page import markdown, print_leaderboard, write_leaderboard

    if as_markdown + as_html + as_latex > 1:
        raise UsageError("the leaderboard is written as --markdown, --html or --latex: choose one")
    board = rank(results_dir, _with_runs(results_dir, run, filters))
    if as_markdown:
        print(markdown(board))
    elif as_html:
        print(f"written to {write_leaderboard(board, results_dir / 'leaderboard.html')}")
    else:
        print_leaderboard(board, _console_of(as_latex))
    return EXIT_OK


@infoplan.command(
    "audit", cls=Command,
    help="Recompute stored runs with other libraries.",
    examples=["infoplan audit", "infoplan audit puct-copod-helens seeds=[0,3]"],
)  # fmt: skip
@run_setting("which run; all if left out")
@RESULTS
@setting("seeds", Seeds(), "which seeds; all if left out")
@setting("epochs", Epochs(), "which epochs are recomputed; all if left out")
@setting("terrain.path", UserPath(), "file of the runs whose map came from one, to check the truth")
@setting("terrain.member", Text(), "the map's name in a .zip archive")
def audit(
    run: str | None,
    results_dir: Path,
    seeds: Sequence[int] | None,
    epochs: Any,
    terrain_path: Path | None,
    terrain_member: str | None,
) -> int:
    """Audit runs."""
    from infoplan.analyse.audit import audit
    from infoplan.draw.console import wide_console
    from infoplan.draw.findings_table import print_findings
    from infoplan.study.stored_terrains import stored_terrains

    path = None if terrain_path is None else str(terrain_path)
    maps = stored_terrains(results_dir, path, terrain_member)
    known = {terrain.sha256: terrain.elevation for terrain in maps}
    findings = list(audit(results_dir, run, seeds, known, epochs))
    print_findings(findings, wide_console())
    return EXIT_OK if all(finding.holds for finding in findings) else EXIT_FAILED


@infoplan.command(
    "animate", cls=Command,
    help="Draw one stored mission as GIF or MP4.",
    examples=["infoplan animate puct-copod-helens seed=0 format=mp4"],
)  # fmt: skip
@run_setting("which run; the only one, or the paper's own method, if left out")
@RESULTS
@setting("seed", click.IntRange(min=0), "which of its missions", default=0)
@setting("format", click.Choice(["gif", "mp4"]), "of the file; mp4 needs ffmpeg", default="gif")
@setting("fps", Number(min=0, max=50, min_open=True), "pictures a second", default=4.0)
@TRUST
@setting("detector.function", Text(), "the run's own detector, which may be imported then")
@setting("model.function", Text(), "the run's own model, which may be imported then")
def animate(
    run: str | None,
    results_dir: Path,
    seed: int,
    format: str,
    fps: float,
    trust: bool,
    detector_function: str | None,
    model_function: str | None,
) -> int:
    """Animate a mission."""
    from infoplan.draw.animate import animate
    from infoplan.draw.console import wide_console

    path = animate(
        results_dir, wide_console(), run=run, seed=seed, file_format=format, fps=fps, trust=trust,
        named={"detector": detector_function, "model": model_function},
    )  # fmt: skip
    print(f"animated to {path}")
    return EXIT_OK


@infoplan.group("terrain", cls=Group, help="The maps: list, show or fetch them.",
                examples=["infoplan terrain show terrain=jacksboro"])  # fmt: skip
def terrain() -> None:
    """Hold the commands about maps."""


@terrain.command("list", cls=Command, help="Say which maps are on this machine.",
                 examples=["infoplan terrain list"])  # fmt: skip
def list_terrains() -> int:
    """List the maps."""
    from infoplan.terrain import TERRAINS, available

    there = available()
    for name, what in TERRAINS.items():
        print(f"{name:12} {what}\n{'':12} {there[name]}")
    return EXIT_OK


@terrain.command(
    "show", cls=Command, more=options_of("TERRAIN"),
    help="Print a map's statistics and draw it with the pilot path.",
    examples=["infoplan terrain show terrain=random_field terrain.seed=4"],
)  # fmt: skip
@RESULTS
def show_terrain(results_dir: Path, overrides: list[str]) -> int:
    """Show a map."""
    from infoplan.draw.terrain_map import draw_terrain, terrain_summary
    from infoplan.hydra_front.compose import compose
    from infoplan.terrain import load_terrain

    options = vars(compose(overrides).terrain)
    if "on_missing" in options:
        options["on_missing"] = "error"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loaded = load_terrain(**options)
    for warning in caught:
        print(f"WARNING: {warning.message}", file=sys.stderr)
    print(terrain_summary(loaded))
    print(f"drawn to {draw_terrain(loaded, results_dir / 'figures')}")
    return EXIT_OK


@terrain.command("fetch", cls=Command, help="Download the map of Mount St. Helens (80 kB).",
                 examples=["infoplan terrain fetch"])  # fmt: skip
def fetch_terrain() -> int:
    """Fetch the map."""
    from infoplan.terrain import fetch_helens

    print(f"helens is at {fetch_helens()}")
    return EXIT_OK


class CommandName(click.ParamType):
    """A command, or one of its subcommands."""

    name, words = "command", "a command"

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer commands, after the name of a group its subcommands."""
        group: click.Command = infoplan
        for name in ctx.meta[GIVEN].get("command", ()):
            group = getattr(group, "commands", {}).get(name, group)
        return [
            CompletionItem(name, help=command.help)
            for name, command in getattr(group, "commands", {}).items()
            if name.startswith(incomplete)
        ]


@infoplan.command("help", cls=Command, help="Tell about a command, as --help after it does.",
                  examples=["infoplan help terrain show"])  # fmt: skip
@setting("command", CommandName(), "which; all if none is named", default=(), bare=-1, named=False)
@click.pass_context
def help_command(ctx: click.Context, command: tuple[str, ...]) -> int:
    """Show the page of a command."""
    _enter([*command, "--help"])
    return EXIT_OK


def call(arguments: list[str]) -> int:
    """Parse a command line and call its function; return the exit status.

    Raises
    ------
    UsageError
        If the line is wrong.
    """
    try:
        return _enter(arguments)
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.ClickException as error:
        raise UsageError(error.format_message()) from error


def _enter(arguments: list[str]) -> int:
    width = page_width()
    words = list(arguments)
    if any("=" in word for word in words):  # else help need not wait for NumPy
        from infoplan.text_options import renamed

        words = [renamed(word) if "=" in word else word for word in words]
    with infoplan.make_context(
        "infoplan", words, terminal_width=width, max_content_width=width
    ) as ctx:
        return int(infoplan.invoke(ctx) or 0)


def _study(results_dir: Path, run: str | list[str] | None, filters: dict[str, Any]) -> "Selection":
    """Find the study that options of runs choose."""
    from infoplan.analyse.stretches import demand_truth
    from infoplan.analyse.tables import find_study

    study = find_study(results_dir, run=run, **_wanted(results_dir, filters))
    demand_truth(study, "figures and claims")
    return study


def _with_runs(
    results_dir: Path, run: str | list[str] | None, filters: dict[str, Any]
) -> dict[str, Any]:
    """Add to filters of scores the runs that a command line names, if any."""
    from infoplan.study.run_names import find_run

    if run is None:
        return filters
    named = [run] if isinstance(run, str) else run
    return {**filters, "run": [find_run(results_dir, text) for text in named]}


def _wanted(results_dir: Path, filters: dict[str, Any]) -> dict[str, Any]:
    """Name filters as the tables do."""
    from infoplan.study.run_names import find_run

    wanted = {
        f"{name}.name" if name in ("model", "fault") else name: value
        for name, value in filters.items()
    }
    if isinstance(wanted.get("replay"), str):
        wanted["replay"] = find_run(results_dir, wanted["replay"])
    return wanted


def _version(ctx: click.Context, asked: bool) -> None:
    if asked and not ctx.resilient_parsing:
        from infoplan import __version__

        print(f"infoplan {__version__}")
        ctx.exit()


def _complete(ctx: click.Context, text: str | None) -> None:
    if text is None or ctx.resilient_parsing:
        return
    from infoplan.completion import serve

    serve(infoplan, text)
    ctx.exit()
