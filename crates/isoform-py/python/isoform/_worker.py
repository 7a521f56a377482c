"""A process that fits scans for `isoform.distributed`: a job, then sources in, rows out."""

from __future__ import annotations

import os
import pickle
import signal
import sys


def main() -> None:
    """Reads pickles until there are no more."""
    # Ctrl-C is for the one who started this.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    rows = os.fdopen(os.dup(1), "wb")
    # What else is printed must not come between the rows.
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
