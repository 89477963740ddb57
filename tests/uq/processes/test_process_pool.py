"""Processes that do tasks: order, errors, deaths, and that all of them end."""

import math
import operator
import os
import subprocess
import time

import pytest

from rig.child_process import start_module
from uq.processes.process_pool import ProcessPool, run_map


@pytest.fixture
def pool():
    with ProcessPool(2) as pool:
        yield pool


def test_values_come_in_the_order_of_their_items(pool, tmp_path):
    assert list(pool.map(math.sqrt, [9.0, 4.0, 1.0, 0.0])) == [3.0, 2.0, 1.0, 0.0]
    assert list(pool.map(math.sqrt, [])) == []
    assert os.getpgid(0) not in list(pool.map(os.getpgid, [0, 0]))  # this process does none of them
    os.mkfifo(pipe := tmp_path / "pipe")  # whose ends open together: two tasks at once, or neither would end
    ends = [f"timeout 60 cat {pipe}", f"timeout 60 sh -c 'echo both > {pipe}'"]
    assert list(pool.map(subprocess.getoutput, ends)) == ["both", ""]


def test_the_error_is_that_of_the_first_item_as_if_they_were_called_in_turn(pool):
    with pytest.raises(ValueError, match="'b'"):
        list(pool.map(int, ["1", "b", "2", "c", "3"]))
    assert list(pool.map(int, ["1", "2"])) == [1, 2]  # of the tasks before nothing is left


def test_this_process_may_help():
    with ProcessPool(1, helping=True) as pool:
        assert list(pool.map(math.sqrt, [9.0, 4.0, 1.0])) == [3.0, 2.0, 1.0]
        with pytest.raises(ValueError, match="'a'"):
            list(pool.map(int, ["a", "b", "c"]))


def test_a_process_that_dies_is_no_value(pool):
    with pytest.raises(MemoryError, match="ended with status 3"):
        list(pool.map(os._exit, [3, 3]))
    assert list(pool.map(math.sqrt, [4.0])) == [2.0]


def test_all_processes_end_with_the_context():
    """However it ends, and in whatever order their threads wake."""
    for _ in range(3):
        with ProcessPool(3) as pool:
            list(pool.map(operator.abs, [-1, -2, -3, -4]))
            processes = [worker.process for worker in pool.workers if worker.process is not None]
            assert next(pool.answers(time.sleep, [0.0, 60.0, 60.0])).number == 0  # then nobody waits any more
        assert processes
        assert all(process.poll() is not None for process in processes)


def test_few_runs_start_no_process():
    with run_map(15, 8, lambda *_: None) as map_runs:
        assert map_runs is map
    with run_map(60, 1, lambda *_: None) as map_runs:
        assert map_runs is map


def test_a_process_ends_with_the_command_that_started_it():
    process = start_module("uq.processes", stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    process.stdin.close()
    assert process.wait(60) == 0


def test_what_is_asked_for_later_is_done_first(tmp_path):
    log = tmp_path / "log"
    with ProcessPool(1) as pool:
        early = pool.map(subprocess.getoutput, [f"echo early {k} >> {log}" for k in range(6)])
        late = pool.map(subprocess.getoutput, [f"echo late {k} >> {log}" for k in range(3)])
        assert list(late) == [""] * 3
        assert list(early) == [""] * 6
    done = log.read_text("utf-8").splitlines()
    begun = done[0] == "early 0"  # and not broken off
    assert done[begun : begun + 3] == ["late 0", "late 1", "late 2"]
    assert sorted(done) == [*(f"early {k}" for k in range(6)), *(f"late {k}" for k in range(3))]
