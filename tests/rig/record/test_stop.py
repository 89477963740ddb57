"""The end of a recording, asked for by a signal that comes at any step of the wait for it."""

import subprocess
import sys

SIGNALS = """
import signal
from rig.record.session import Stop

signal.signal(signal.SIGALRM, lambda *_: stop.set())
for k in range(500):
    stop = Stop()
    signal.setitimer(signal.ITIMER_REAL, 1e-6 * (1 + k % 100))
    while not stop.wait(1e-5):
        pass
"""


def test_a_signal_during_the_wait_for_it_ends_it():
    """With ``threading.Event``, whose lock the waiting thread holds at times, this hangs."""
    subprocess.run([sys.executable, "-c", SIGNALS], check=True, timeout=120)
