"""Ctrl-C ends a command wherever its exception gets lost; what tidies up is left in peace."""

import signal
import subprocess
import sys

import pytest

COMMAND = """
import signal, sys, time, weakref
from uq.cli import main, schema

class Something:
    pass

def interrupt(*_):
    signal.raise_signal(signal.SIGINT)

def work():
    for _ in range(1000):
        time.sleep(0.01)

def run(arguments):
{}
    return 0

schema.run = run
sys.argv = ["inertia", "schema", "experiment"]
sys.exit(main.main())
"""
LOST = {
    "any exception is caught": """
    try:
        interrupt()
    except:
        pass
    work()
""",
    "the callback of a weak reference": """
    something = Something()
    reference = weakref.ref(something, interrupt)
    del something
    work()
""",
    "a destructor": """
    Something.__del__ = interrupt
    Something()
    work()
""",
    "another exception": """
    try:
        interrupt()
    except BaseException as error:
        raise RuntimeError("INTERNAL: error in a callback") from error
""",
    "twice": """
    for _ in range(2):
        try:
            interrupt()
            work()
        except:
            pass
    work()
""",
}
TIDIED_UP = """
    try:
        interrupt()
    finally:
        time.sleep(0.2)
        print("tidied up")
"""


def ended(steps, handler=signal.default_int_handler, patience=None):
    """Status, output and messages of a command that does these steps; it inherits whether SIGINT is ignored."""
    before = signal.signal(signal.SIGINT, handler)
    try:
        command = [sys.executable, "-c", COMMAND.format(steps)]
        process = subprocess.run(command, capture_output=True, text=True, timeout=patience)
    finally:
        signal.signal(signal.SIGINT, before)
    return process.returncode, process.stdout, process.stderr


@pytest.mark.parametrize("steps", LOST.values(), ids=LOST)
def test_an_interrupt_that_gets_lost_comes_again(steps):
    assert ended(steps) == (130, "", "error: interrupted\n")


def test_an_interrupt_on_its_way_does_not_come_again():
    assert ended(TIDIED_UP) == (130, "tidied up\n", "error: interrupted\n")


def test_python_s_end_does_not_wait_for_threads():
    """JAX waits in a thread of 60 s whether the device answers; some of what it compiles is compiled in threads."""
    steps = "    import threading\n    threading.Timer(60, print).start()\n    print('begun')\n    interrupt()"
    assert ended(steps, patience=30) == (130, "begun\n", "error: interrupted\n")


def test_where_it_is_ignored_from_the_start_it_is_ignored():
    """As a shell's script has it for what it starts with ``&``: a terminal's Ctrl-C is not for it."""
    assert ended("    interrupt()", signal.SIG_IGN) == (0, "", "")
