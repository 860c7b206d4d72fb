"""The console command: parse, call, print."""

import os
import sys

USAGE = """\
infoplan: informative planning in the presence of outliers

  infoplan run [option=value ...]      run a configuration with all its seeds
  infoplan run -m [option=v1,v2 ...]   run every combination, in one pool of workers
  infoplan audit [run=... seeds=...]   recompute stored runs with other libraries
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


def _audit(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.analyse.audit import audit, render
    from infoplan.config import seed_list
    from infoplan.overrides import parse
    from infoplan.terrain import find_helens, load_terrain

    defaults = {"results_dir": "results", "run": None, "seeds": None, "terrain.path": None}
    chosen = parse("audit", arguments, defaults)
    seeds = None if chosen["seeds"] is None else seed_list(chosen["seeds"])
    maps = [load_terrain(name) for name in ("volcano", "jacksboro")]
    if (helens := find_helens()) is not None:
        maps.append(load_terrain("helens", path=helens))
    if chosen["terrain.path"] is not None:
        maps.append(load_terrain("file", path=chosen["terrain.path"]))
    known = {terrain.name: terrain.elevation for terrain in maps}
    findings = list(audit(Path(chosen["results_dir"]), chosen["run"], seeds, known))
    print(render(findings))
    return EXIT_OK if all(finding.holds for finding in findings) else EXIT_FAILED


def _terrain(arguments: list[str]) -> int:
    from infoplan.errors import UsageError

    action, rest = (arguments[0], arguments[1:]) if arguments else ("", [])
    if action == "list":
        from infoplan.terrain import TERRAINS

        print("\n".join(f"{name:10} {what}" for name, what in TERRAINS.items()))
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
    from infoplan.overrides import parse
    from infoplan.terrain import load_terrain

    chosen = parse(
        "terrain show",
        arguments,
        {
            "terrain": "helens",
            "terrain.path": None,
            "terrain.extent": [0.0, 50.0, 0.0, 50.0],
            "terrain.unit": None,
            "results_dir": "results",
        },
    )
    terrain = load_terrain(
        chosen["terrain"],
        path=chosen["terrain.path"],
        extent=chosen["terrain.extent"],
        unit=chosen["terrain.unit"],
        on_missing="error",
    )
    print(describe(terrain))
    print(f"drawn to {draw_terrain(terrain, Path(chosen['results_dir']) / 'figures')}")
    return EXIT_OK


def _animate(arguments: list[str]) -> int:
    from pathlib import Path

    from infoplan.draw.animate import animate
    from infoplan.overrides import parse
    from infoplan.study.summary import wide_console

    chosen = parse(
        "animate",
        arguments,
        {"results_dir": "results", "run": "", "seed": 0, "format": "gif", "fps": 4},
    )
    path = animate(
        Path(chosen["results_dir"]).expanduser(),
        wide_console(),
        run=chosen["run"] or None,
        seed=chosen["seed"],
        file_format=chosen["format"],
        fps=chosen["fps"],
    )
    print(f"animated to {path}")
    return EXIT_OK


COMMANDS = {"run": _run, "audit": _audit, "terrain": _terrain, "animate": _animate}


def _wants_traceback() -> bool:
    return os.environ.get("HYDRA_FULL_ERROR", "0") not in ("", "0")


if __name__ == "__main__":
    sys.exit(main())
