"""Records shared without a lock: whole ones only, and a writer that is slow is waited for."""

import threading
import time

import numpy as np
import pytest

from pepper_drake.robot_server.robot.shared_state import SharedRecord

DTYPE = np.dtype([("numbers", "i8", 5000), ("word", "U8")])


@pytest.fixture
def records():
    mine = SharedRecord(DTYPE)
    theirs = SharedRecord(DTYPE, mine.name)
    yield mine, theirs
    theirs.close()
    mine.close()


def test_what_is_written_is_read_and_other_fields_stay(records):
    mine, theirs = records
    mine.write(numbers=np.arange(5000), word="first")
    mine.write(word="second")
    content = theirs.read()
    assert str(content["word"]) == "second"
    np.testing.assert_array_equal(content["numbers"], np.arange(5000))
    assert theirs.writes == 2


def test_no_reader_sees_half_a_record(records):
    mine, theirs = records
    stop = threading.Event()

    def write():
        number = 0
        while not stop.is_set():
            mine.write(numbers=number)
            number += 1
            time.sleep(1e-4)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        for _ in range(300):
            assert len(set(theirs.read()["numbers"].tolist())) == 1
    finally:
        stop.set()
        thread.join()


def test_a_writer_that_is_interrupted_is_waited_for(records):
    mine, theirs = records
    mine.write(word="whole")
    mine._record["before"] = 2  # A write has begun.

    def finish():
        time.sleep(0.3)
        mine._record["after"] = 2

    thread = threading.Thread(target=finish)
    thread.start()
    assert str(theirs.read()["word"]) == "whole"
    thread.join()
    mine._record["before"] = 3
    with pytest.raises(RuntimeError, match="stopped"):
        theirs.read()
