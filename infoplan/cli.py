"""The console command: parse, call, print."""

import os
import re
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from infoplan.analyse.tables import Selection

USAGE = """\
infoplan: informative planning in the presence of outliers

  infoplan run [option=value ...]      run a configuration with all its seeds
  infoplan run -m [option=v1,v2 ...]   run every combination, in one pool of workers
  infoplan replay <run> detector=...   its samples through another detector or model
  infoplan status [option=v1,v2 ...]   what is done, failed, missing
  infoplan audit [run=... seeds=...]   recompute stored runs with other libraries
  infoplan figures [fig5 fig7 ...]     draw the paper's figures from stored results
  infoplan claims [--json|--markdown]  judge the paper's claims by stored results
  infoplan leaderboard                 methods ranked over maps; --markdown, --html
  infoplan report                      curves, claims and maps as one HTML page
  infoplan show [run]                  one stored run: curve, detector, time
  infoplan animate [run=... seed=...]  one stored mission as GIF or MP4
  infoplan terrain list|show|fetch     the maps

infoplan run --help lists the options; --cfg job shows the configuration that would run.
Every command takes results_dir=..., the folder of the tables (default: results).
"""

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130


def main(argv: list[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    argv
        Arguments without the program's name; those of the process if None.

    Returns
    -------
    int
        0: done; 1: a run failed; 2: a usage error; 130: interrupted.
    """
    arguments = sys.argv[1:] if argv is None else argv
    if argv is None:
        os.environ["MPLBACKEND"] = "Agg"  # of a notebook, or a screen, nothing may be inherited
    from infoplan.errors import RunError, UsageError

    try:
        return _dispatch(arguments)
    except KeyboardInterrupt:
        print(
            "interrupted: finished missions are kept; the same command goes on where it stopped",
            file=sys.stderr,
        )
        return EXIT_INTERRUPTED
    except (UsageError, RunError) as error:
        if _wants_traceback():
            raise
        print(f"infoplan: {error}", file=sys.stderr)
        return EXIT_USAGE if isinstance(error, UsageError) else EXIT_FAILED
    except BrokenPipeError:
        # The reader of a pipe has left; nothing more can be said to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_FAILED
    except Exception as error:
        if _wants_traceback():
            raise
        print(
            f"infoplan: unexpected {type(error).__name__}: {error} "
            "(HYDRA_FULL_ERROR=1 shows where)",
            file=sys.stderr,
        )
        return EXIT_FAILED


def _dispatch(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(USAGE, end="")
        return EXIT_OK if arguments else EXIT_USAGE
    if arguments[0] == "--version":
        from infoplan import __version__

        print(f"infoplan {__version__}")
        return EXIT_OK
    command, rest = arguments[0], arguments[1:]
    if command in ("-sc", "--shell-completion") or command.startswith("--shell-completion="):
        from infoplan.hydra_front import complete

        return complete(arguments)
    if command not in COMMANDS:
        from infoplan.errors import UsageError
        from infoplan.wording import suggest

        raise UsageError(
            f"there is no command {command!r}{suggest(command, COMMANDS)}: "
            f"use {', '.join(COMMANDS)}; infoplan --help tells what they do"
        )
    return COMMANDS[command](rest)


def _run(arguments: list[str]) -> int:
    from infoplan.hydra_front import run

    return run(arguments)


def _status(arguments: list[str]) -> int:
    from infoplan.study.status import status

    return status(arguments)


def _audit(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.analyse.audit import audit, render
    from infoplan.config import seed_list
    from infoplan.overrides import parse
    from infoplan.study.identity import stored_terrains

    defaults: dict[str, Any] = dict.fromkeys(["run", "seeds", "terrain.path", "terrain.member"])
    chosen = parse("audit", arguments, {"results_dir": "results"} | defaults)
    seeds = None if chosen["seeds"] is None else seed_list(chosen["seeds"])
    results_dir = Path(chosen["results_dir"]).expanduser()
    maps = stored_terrains(results_dir, chosen["terrain.path"], chosen["terrain.member"])
    known = {terrain.sha256: terrain.elevation for terrain in maps}
    findings = list(audit(results_dir, chosen["run"], seeds, known))
    print(render(findings))
    return EXIT_OK if all(finding.holds for finding in findings) else EXIT_FAILED


def _terrain(arguments: list[str]) -> int:
    from infoplan.errors import UsageError

    action, rest = (arguments[0], arguments[1:]) if arguments else ("", [])
    if action == "list":
        from infoplan.terrain import TERRAINS, available

        there = available()
        for name, what in TERRAINS.items():
            print(f"{name:12} {what}\n{'':12} {there[name]}")
    elif action == "fetch":
        from infoplan.terrain import fetch_helens

        print(f"helens is at {fetch_helens()}")
    elif action == "show":
        return _show_terrain(rest)
    else:
        raise UsageError(f"infoplan terrain {action}: say what: use list, show or fetch")
    return EXIT_OK


def _show_terrain(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.draw.terrain_map import describe, draw_terrain
    from infoplan.hydra_front import compose_terrain
    from infoplan.overrides import parse
    from infoplan.terrain import load_terrain

    wanted = [text for text in arguments if text.startswith(("terrain=", "terrain."))]
    rest = [text for text in arguments if text not in wanted]
    chosen = parse("terrain show", rest, {"terrain": "helens", "results_dir": "results"})
    options = vars(compose_terrain(wanted))
    if "on_missing" in options:
        options["on_missing"] = "error"
    terrain = load_terrain(**options)
    print(describe(terrain))
    folder = Path(chosen["results_dir"]).expanduser()
    print(f"drawn to {draw_terrain(terrain, folder / 'figures')}")
    return EXIT_OK


def _animate(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.draw.animate import animate
    from infoplan.overrides import parse
    from infoplan.study.summary import wide_console

    chosen = parse(
        "animate",
        arguments,
        {"results_dir": "results", "run": "", "seed": 0, "format": "gif", "fps": 4, "trust": False},
    )
    path = animate(
        Path(chosen["results_dir"]).expanduser(),
        wide_console(),
        run=chosen["run"] or None,
        seed=chosen["seed"],
        file_format=chosen["format"],
        fps=chosen["fps"],
        trust=chosen["trust"] is True,
    )
    print(f"animated to {path}")
    return EXIT_OK


def _figures(arguments: list[str]) -> int:
    from infoplan.draw.figures import check_names, draw_figures

    named, rest = _named(arguments)
    names = check_names(named)
    study, chosen = _study("figures", rest, {"seed": 0, "--seeds": False})
    problems = list(study.notes)
    drawn = draw_figures(study, names, seed=chosen["seed"], single_seeds=chosen["--seeds"])
    for figure in drawn:
        for path in figure.files:
            print(path)
        problems += [figure.problem] if figure.problem else []
    for problem in problems:
        print(problem, file=sys.stderr)
    return EXIT_FAILED if any(figure.problem for figure in drawn) else EXIT_OK


def _claims(arguments: list[str]) -> int:
    from infoplan.analyse.claims import judge_claims
    from infoplan.draw.claims_table import as_json, markdown, print_claims
    from infoplan.errors import UsageError
    from infoplan.study.summary import wide_console

    study, chosen = _study("claims", arguments, {"--json": False, "--markdown": False})
    if chosen["--json"] and chosen["--markdown"]:
        raise UsageError("claims are written as --json or as --markdown, not both")
    claims = judge_claims(study)
    if chosen["--json"]:
        print(as_json(claims, study))
    elif chosen["--markdown"]:
        print(markdown(claims, study))
    else:
        print_claims(claims, study, wide_console())
    return EXIT_OK


def _report(arguments: list[str]) -> int:
    from infoplan.analyse.tables import find_missions
    from infoplan.draw.report import write_report

    missions, _ = _study("report", arguments, {}, find_missions)
    print(f"reported to {write_report(missions)}")
    return EXIT_OK


def _replay(arguments: list[str]) -> int:
    from functools import partial
    from pathlib import Path

    from infoplan.draw.replay_table import print_replay
    from infoplan.errors import UsageError
    from infoplan.overrides import parse
    from infoplan.study.replay import replay_run
    from infoplan.study.summary import wide_console

    named = [a for a in arguments if "=" not in a and a[:1] not in ("-", "~")]
    rest = [argument for argument in arguments if argument not in named]
    if len(named) != 1:
        raise UsageError(
            f"infoplan replay takes one stored run, not {len(named)}: infoplan replay <run> "
            "detector=best, where <run> is its name or hash (infoplan status lists them)"
        )
    defaults = {"results_dir": "results", "seeds": None, "n_jobs": -1, "resume": True}
    own = [a for a in rest if a.startswith("-") or a.partition("=")[0] in defaults]
    chosen = parse("replay", own, defaults)
    console = wide_console()
    results_dir = Path(chosen.pop("results_dir")).expanduser()
    overrides = [argument for argument in rest if argument not in own]
    tell = partial(console.print, soft_wrap=True, markup=False)
    done = replay_run(results_dir, named[0], overrides, tell=tell, **chosen)
    print_replay(done, results_dir, console)
    return EXIT_FAILED if done.failed else EXIT_OK


def _leaderboard(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.analyse.leaderboard import rank
    from infoplan.draw.leaderboard_page import markdown, print_leaderboard, write_page
    from infoplan.errors import UsageError
    from infoplan.overrides import parse
    from infoplan.study.summary import wide_console

    defaults: dict[str, Any] = {"results_dir": "results", "--markdown": False, "--html": False}
    filters = {
        "planner",
        "detector",
        "model",
        "terrain",
        "rho",
        "seed",
        *_options_of_runs(arguments),
    }
    chosen = parse("leaderboard", arguments, defaults | dict.fromkeys(filters))
    if chosen["--markdown"] and chosen["--html"]:
        raise UsageError("the leaderboard is written as --markdown or as --html, not both")
    folder = Path(chosen["results_dir"]).expanduser()
    board = rank(folder, {name: chosen[name] for name in filters if chosen[name] is not None})
    if chosen["--markdown"]:
        print(markdown(board))
    elif chosen["--html"]:
        print(f"written to {write_page(board, folder / 'leaderboard.html')}")
    else:
        print_leaderboard(board, wide_console())
    return EXIT_OK


def _show(arguments: list[str]) -> int:
    from infoplan.analyse.tables import find_missions
    from infoplan.draw.show import show
    from infoplan.errors import UsageError
    from infoplan.overrides import parse
    from infoplan.study.summary import wide_console

    named, rest = _named(arguments)
    if len(named) > 1:
        raise UsageError(f"infoplan show takes one run, not {len(named)}")
    runs = [f"run={name}" for name in named]
    chosen = parse("show", runs + rest, {"results_dir": "results", "run": ""})
    show(find_missions(chosen["results_dir"], run=chosen["run"] or None), wide_console())
    return EXIT_OK


def _named(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Part the plain names from the options and flags."""
    named = [a for a in arguments if "=" not in a and not a.startswith("-")]
    return named, [argument for argument in arguments if argument not in named]


def _study(
    command: str,
    arguments: list[str],
    defaults: dict[str, Any],
    find: "Callable[..., Selection] | None" = None,
) -> "tuple[Selection, dict[str, Any]]":
    """Read a command's options; find the study that they, and any options of a run, choose."""
    from infoplan.analyse.tables import find_study
    from infoplan.overrides import parse

    of_runs = _options_of_runs(arguments)
    filters = [argument for argument in arguments if argument.partition("=")[0] in of_runs]
    rest = [argument for argument in arguments if argument not in filters]
    chosen = parse(command, rest, {"results_dir": "results", "terrain": None, **defaults})
    wanted = parse(command, filters, dict.fromkeys(of_runs))
    find = find or find_study
    return find(chosen["results_dir"], terrain=chosen["terrain"], **wanted), chosen


def _options_of_runs(arguments: list[str]) -> set[str]:
    """Options that a run can be chosen by; groups and rho have their own names."""
    from infoplan.config import METHODS, TERRAIN_SCHEMAS, MissionConfig, options

    names = {name for name, _, _ in options(MissionConfig()) if "." in name}
    for group, choices in METHODS.items():
        names |= {name for one in choices.values() for name, _, _ in options(one, f"{group}.")}
    for schema in TERRAIN_SCHEMAS.values():
        names |= {name for name, _, _ in options(schema(), "terrain.")}
    # Of options of the user's own functions, and of PyOD's classes, there is no list.
    own = (argument.partition("=")[0] for argument in arguments)
    names |= {name for name in own if re.match(r"\w+\.(options|params)\.", name)}
    # Where a map came from is not stored.
    stored = names - {"terrain.path", "terrain.member", "terrain.on_missing"}
    return stored | {"budget", "grid", "terrain.sha256", "replay"}


COMMANDS = {
    "run": _run,
    "replay": _replay,
    "status": _status,
    "figures": _figures,
    "claims": _claims,
    "report": _report,
    "show": _show,
    "leaderboard": _leaderboard,
    "audit": _audit,
    "terrain": _terrain,
    "animate": _animate,
}


def _wants_traceback() -> bool:
    return os.environ.get("HYDRA_FULL_ERROR", "0") not in ("", "0")


if __name__ == "__main__":
    sys.exit(main())
