"""Memory of processes, whatever that of the process which starts them."""

# Run a command, and add a line to a file: its seconds and bytes. The peak that the system counts begins with that of
# the process which starts the command: this one is small.
COUNTING = """
import os, subprocess, sys

process = subprocess.Popen(sys.argv[2:])
_, status, used = os.wait4(process.pid, 0)
process.returncode = os.waitstatus_to_exitcode(status)
with open(sys.argv[1], "a") as file:
    print(used.ru_utime + used.ru_stime, used.ru_maxrss * (1 if sys.platform == "darwin" else 1024), file=file)
sys.exit(process.returncode % 256)
"""


def own_peak():
    """Largest memory of this process since it began [bytes], on Linux."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) * 1024
