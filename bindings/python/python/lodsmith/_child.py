"""A process that makes levels for a worker of :mod:`lodsmith.batch`, so that a crash or a hang ends only this process.

Each line of standard input has an input, its folder, the folder for the levels, and options; each line of standard output
has the result.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading


def main() -> None:
    from . import _lodsmith as _native

    requests: "queue.SimpleQueue[str]" = queue.SimpleQueue()

    def listen() -> None:
        for line in sys.stdin:
            requests.put(line)
        # The worker has ended or was killed: nobody needs the result any more.
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        request = json.loads(requests.get())
        os.chdir(request["folder"])
        done = _native.run_job("lod", [request["input"]], None, request["out_dir"], request["options"], None)
        print(json.dumps(done), flush=True)


if __name__ == "__main__":
    main()
