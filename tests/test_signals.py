import asyncio
import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from pepper_drake.signals import run_async

SCRIPT = """
import multiprocessing, sys, time
from pepper_drake.signals import end_with_parent

def work():
    end_with_parent()
    print("works", flush=True)
    time.sleep(60.0)

if __name__ == "__main__":
    multiprocessing.get_context("fork").Process(target=work).start()
    time.sleep(60.0)
"""


def test_a_worker_ends_with_the_process_that_started_it(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "works\n"
        (worker,) = psutil.Process(process.pid).children()
        process.kill()
        process.wait()
        end = time.monotonic() + 10.0
        while worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE:
            assert time.monotonic() < end
            time.sleep(0.02)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_cancels_a_coroutine_which_ends_in_order(number):
    told = []

    async def work():
        try:
            os.kill(os.getpid(), number)
            await asyncio.sleep(60.0)
        finally:
            told.append("closed")

    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt):
        run_async(work())
    assert told == ["closed"]
    assert signal.getsignal(number) is before


def test_a_coroutine_returns_what_it_makes():
    assert run_async(asyncio.sleep(0.0, "done")) == "done"
