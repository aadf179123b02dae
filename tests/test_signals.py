import subprocess
import sys
import time

import psutil

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
