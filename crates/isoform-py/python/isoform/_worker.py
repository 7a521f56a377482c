"""Worker process of `isoform.distributed`: reads a job, then sources, and writes rows."""

from __future__ import annotations

import os
import pickle
import signal
import sys


def main() -> None:
    """Process pickled sources until the input ends."""
    # The parent process handles Ctrl-C.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    rows = os.fdopen(os.dup(1), "wb")
    # Other output must not mix with the rows.
    os.dup2(2, 1)
    job = pickle.load(sys.stdin.buffer)
    while True:
        try:
            source = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(job.row(source), rows)
        rows.flush()


if __name__ == "__main__":
    main()
