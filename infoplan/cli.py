"""The console command: call, and say in one sentence what went wrong."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

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
    with _streams():
        return _caught(arguments)


def _caught(arguments: list[str]) -> int:
    from infoplan.caches import prepare_matplotlib
    from infoplan.errors import RunError, UsageError

    prepare_matplotlib()
    try:
        from infoplan.commands import call

        status = call(arguments)
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        _say("interrupted: finished missions are kept; the same command goes on where it stopped")
        return EXIT_INTERRUPTED
    except (UsageError, RunError) as error:
        if _wants_traceback():
            raise
        _say(f"infoplan: {error}")
        return EXIT_USAGE if isinstance(error, UsageError) else EXIT_FAILED
    except BrokenPipeError:
        # The reader of a pipe has left; nothing more can be said to it.
        _throw_away(sys.stdout)
        return EXIT_FAILED
    except Exception as error:
        if isinstance(error, OSError) and getattr(sys.stdout, "failure", None) is not None:
            _throw_away(sys.stdout)
            reason = error.strerror or error
            _say(f"infoplan: standard output cannot be written ({reason}): what it should show "
                 "is lost")  # fmt: skip
            return EXIT_FAILED
        if _wants_traceback():
            raise
        _say(
            f"infoplan: unexpected {type(error).__name__}: {error} (HYDRA_FULL_ERROR=1 shows where)"
        )
        return EXIT_FAILED


class _Output:
    """Standard output that remembers that it could not be written to.

    Parameters
    ----------
    stream
        The stream itself, or a stand-in if it is closed.
    closed
        Whether it is.

    Attributes
    ----------
    failure
        What the last attempt ended in, if that was an error.
    """

    def __init__(self, stream: TextIO, closed: bool):
        self.stream, self.is_closed = stream, closed
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        """Write, and remember what went wrong."""
        return int(self._remembered("write", text))

    def flush(self) -> None:
        """Flush, and remember what went wrong."""
        if not self.is_closed:
            self._remembered("flush")

    def _remembered(self, act: str, *arguments: Any) -> Any:
        try:
            if self.is_closed:
                raise OSError(errno.EBADF, "it is closed")
            return getattr(self.stream, act)(*arguments)
        except OSError as error:
            self.failure = error
            raise

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def _streams() -> Iterator[None]:
    """Give the command streams that it can write to, whatever the caller has closed.

    What a stream's encoding has not is written as an escape.
    """
    before = sys.stdout, sys.stderr
    handlers = {}
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        for stream in filter(None, before):
            if hasattr(stream, "reconfigure") and stream.errors == "strict":
                handlers[stream] = stream.errors
                stream.reconfigure(errors="backslashreplace")
        sys.stdout = _Output(before[0] or nowhere, closed=before[0] is None)
        sys.stderr = before[1] or nowhere
        try:
            yield
        finally:
            for stream, errors in handlers.items():
                with suppress(OSError, ValueError):
                    stream.reconfigure(errors=errors)
            sys.stdout, sys.stderr = before


def _say(sentence: str) -> None:
    """Write to standard error, if anybody listens."""
    from infoplan.wording import harmless

    with suppress(OSError, ValueError):
        print(harmless(sentence), file=sys.stderr, flush=True)


def _throw_away(stream: Any) -> None:
    """Lead a stream nowhere, so that nothing complains when it is closed."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
        stream.flush()


def _wants_traceback() -> bool:
    return os.environ.get("HYDRA_FULL_ERROR", "0") not in ("", "0")


if __name__ == "__main__":
    sys.exit(main())
