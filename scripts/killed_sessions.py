#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How much of a session is left when its program is killed while it records?

scripts/killed_sessions.py PALPATE [COUNT]
  PALPATE  the program, such as build/run/app/palpate
  COUNT    sessions (20)

Each session runs in real time with the default camera and a simulated hand, and is killed (SIGKILL)
at a time drawn by chance, with a fixed seed. Then `palpate replay` has to read it, find every force
bit for bit and every checksum right. Prints the time from the last tick that was kept to the kill
for each session: two commits a second keep it below one second unless the machine is overloaded.
Exits 1 if a session cannot be read or lost more than 1 s.
"""
import pathlib
import random
import subprocess
import sys
import tempfile
import time

import mcap_messages

MOST_LOST = 1.0  # [s] half a second, the commit itself and a machine with other work


def kept_until(folder):
    """[s since 1970] the last tick in a recording; none if there is none."""
    times = [message[2] for file in folder.glob("*.mcap")
             for message in mcap_messages.messages(file) if message[0] == "/palpate/tick"]
    return 1e-9 * max(times) if times else None


def kill_one(program, folder, seconds):
    """Kills a session `seconds` after its first tick. @return (what replay says, [s] lost)."""
    session = subprocess.Popen(
        [program, "run", "--no-browser", "--port", "0", "--device", "hand:", "--record", folder],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    end = time.time() + 60.0
    while time.time() < end and session.poll() is None and not list(folder.glob("*.mcap")):
        time.sleep(0.01)
    time.sleep(seconds)
    if session.poll() is not None:
        sys.exit(f"killed_sessions: the program ended by itself: {session.stderr.read().strip()}")
    killed = time.time()
    session.kill()
    session.communicate()
    replay = subprocess.run([program, "replay", folder], capture_output=True, text=True)
    last = kept_until(folder)
    words = (replay.stdout + replay.stderr).strip()
    return replay.returncode == 0, words, killed - last if last else float("inf")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    program = pathlib.Path(sys.argv[1]).resolve()
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    chance = random.Random(1)
    good, lost = 0, []
    with tempfile.TemporaryDirectory() as scratch:
        for i in range(count):
            seconds = chance.uniform(2.5, 6.0)
            read, words, seconds_lost = kill_one(program, pathlib.Path(scratch) / str(i), seconds)
            good += read and seconds_lost <= MOST_LOST
            lost.append(seconds_lost)
            print(f"{i + 1}: killed after {seconds:.2f} s, lost the last {seconds_lost:.2f} s: "
                  f"{words.splitlines()[0] if read and words else words}", flush=True)
    print(f"{good} of {count} sessions are readable to within {MOST_LOST} s; lost: "
          f"{sorted(lost)[count // 2]:.2f} s in the median, {max(lost):.2f} s at most")
    sys.exit(0 if good == count else 1)


if __name__ == "__main__":
    main()
