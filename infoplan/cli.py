"""The console command: call, and say in one sentence what went wrong."""

import gc
import os
import sys

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130

COLLECT_AFTER = 50_000
"""So many objects more than before, cycles among them are looked for; Python's own is 700."""


def main(argv: list[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    argv
        Arguments without the program's name; those of the process if None.

    Returns
    -------
    int
        0: done; 1: a run failed, or output was lost; 2: a usage error; 130: interrupted.
    """
    from infoplan.output import standard_streams
    from infoplan.study.signals import stoppable

    arguments = sys.argv[1:] if argv is None else argv
    if argv is None:
        gc.set_threshold(COLLECT_AFTER)  # imports make much that stays: looking for cycles is slow
        os.environ["MPLBACKEND"] = "Agg"  # of a notebook, or a screen, nothing may be inherited
    with stoppable(for_good=argv is None), standard_streams() as output:
        status = _caught(arguments)
        output.flush()
        return status or (EXIT_FAILED if output.lost else EXIT_OK)


def _caught(arguments: list[str]) -> int:
    from infoplan.caches import prepare_matplotlib
    from infoplan.errors import RunError, UsageError
    from infoplan.output import complain
    from infoplan.wording import harmless

    prepare_matplotlib()
    try:
        from infoplan.commands import call

        return call(arguments)
    except KeyboardInterrupt:
        complain(
            "interrupted: finished missions are kept; the same command goes on where it stopped"
        )
        return EXIT_INTERRUPTED
    except (UsageError, RunError) as error:
        if _wants_traceback():
            raise
        complain(harmless(f"infoplan: {error}"))
        return EXIT_USAGE if isinstance(error, UsageError) else EXIT_FAILED
    except Exception as error:
        if _wants_traceback():
            raise
        kind = type(error).__name__
        complain(harmless(f"infoplan: unexpected {kind}: {error} (HYDRA_FULL_ERROR=1 shows where)"))
        return EXIT_FAILED


def _wants_traceback() -> bool:
    return os.environ.get("HYDRA_FULL_ERROR", "0") not in ("", "0")


if __name__ == "__main__":
    sys.exit(main())
