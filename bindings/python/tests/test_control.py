"""Progress, cancellation and the interpreter lock."""

import os
import signal
import subprocess
import sys
import threading
import time

import lodsmith
import pytest

LONG = """
import lodsmith, signal, sys
# A shell starts its background jobs with interrupts ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
ball = lodsmith.icosphere(8)
print("begin", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print("cancelled", flush=True)
    sys.exit(7)
print("done", flush=True)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(
    "call", ["lodsmith.simplify(ball, ratio=0.01)", "lodsmith.compare(ball, ball, samples=10**8)", "FILE"]
)
def test_ctrl_c_cancels(call, tmp_path):
    if call == "FILE":
        lodsmith.icosphere(8).save(tmp_path / "ball.ply")
        call = f"lodsmith.simplify_file({str(tmp_path / 'ball.ply')!r}, {str(tmp_path / 'low.ply')!r}, ratio=0.01)"
    run = subprocess.Popen([sys.executable, "-c", LONG.format(call=call)], stdout=subprocess.PIPE, text=True)
    assert run.stdout.readline() == "begin\n"
    time.sleep(0.3)
    run.send_signal(signal.SIGINT)
    out, _ = run.communicate(timeout=120)
    assert (out, run.returncode) == ("cancelled\n", 7)
    assert not (tmp_path / "low.ply").exists()


def test_progress_never_decreases_and_ends_at_one():
    ball = lodsmith.icosphere(7)
    seen = []
    lodsmith.simplify(ball, ratio=0.05, progress=lambda done, stage: seen.append((done, stage)))
    fractions = [done for done, _ in seen]
    assert len(seen) > 2 and fractions == sorted(fractions) and seen[-1] == (1.0, "done")
    assert 0 <= fractions[0] < 1 and {stage for _, stage in seen} & {"simplify", "fit"}


def test_an_exception_of_progress_ends_the_run():
    def stop(done, stage):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        lodsmith.simplify(lodsmith.icosphere(7), ratio=0.05, progress=stop)


def test_a_bar_of_tqdm():
    tqdm = pytest.importorskip("tqdm").tqdm
    with open(os.devnull, "w") as sink, tqdm(total=100, file=sink) as bar:
        lodsmith.simplify(lodsmith.icosphere(5), ratio=0.1, progress=bar)
        assert bar.n == pytest.approx(100)


def test_other_threads_run_meanwhile():
    ball = lodsmith.icosphere(7)
    ticks, end = [], threading.Event()

    def tick():
        while not end.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.perf_counter()
    lodsmith.simplify(ball, ratio=0.05)
    last = time.perf_counter()
    end.set()
    thread.join()
    # If the lock were held, there would be none.
    assert sum(begin < t < last for t in ticks) > 5


def test_a_time_limit_returns_the_best_result_so_far():
    ball = lodsmith.icosphere(8)
    with pytest.warns(lodsmith.LodsmithWarning, match="time limit"):
        made = lodsmith.simplify(ball, faces=100, time_limit=0.05)
    assert 100 < len(made.faces) and made.report["stopped_by"] == "time_limit"


def test_runs_in_threads_are_independent(ball):
    wanted = lodsmith.simplify(ball, ratio=0.1)
    made = [None] * 4

    def work(i):
        made[i] = lodsmith.simplify(ball, ratio=0.1)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    [t.start() for t in threads]
    [t.join() for t in threads]
    assert all(m.vertices.tobytes() == wanted.vertices.tobytes() for m in made)


def _compare(_):
    ball = lodsmith.icosphere(4)
    return lodsmith.compare(ball, lodsmith.simplify(ball, ratio=0.1))["rms"]["symmetric"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_has_its_own_threads():
    import multiprocessing

    # The threads of this process do not exist in the child.
    wanted = _compare(0)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_compare, range(4)).get(timeout=120) == [wanted] * 4
