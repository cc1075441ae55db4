#!/usr/bin/env python3
"""Kills server, workers and clients at random moments (kill -9) while clients submit small jobs, and then
checks what is left: every acknowledged job came to exactly one end, every result has its digest, equal jobs made
equal meshes however often they had to go on, no file is orphaned or missing. Exit status 0 if so.

usage: chaos.py --remeshd FILE --remesh FILE [--kills N] [--seed 1] [--clients 4] [--keep]

Without --kills it kills as often as REMESH_TEST_KILLS says, or 200 times.
"""

import argparse
import collections
import hashlib
import json
import math
import os
import pathlib
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from service_processes import Server, box

TERMINAL = ("succeeded", "failed", "cancelled", "quarantined")
EDGE_LENGTH = 0.5
SHAPES = ((1.0, 1.2, 1.5), (1.1, 1.9, 1.3), (1.6, 1.6, 1.0), (2.0, 1.1, 1.2))
# Of all kills.
SHARE_OF_SERVER = 0.4
SHARE_OF_WORKERS = 0.4
LONGEST_PAUSE = 300.0  # between the ends of two jobs that are left, on a slow machine


class Client(threading.Thread):
    """Submits jobs, watches some and cancels some, until told to stop."""

    def __init__(self, arguments, server, folder, seed):
        super().__init__(daemon=True)
        self.command = [arguments.remesh, "--server", server.address]
        self.folder = folder
        self.random = random.Random(seed)
        self.acknowledged = []
        self.process = None
        self.is_stopping = False

    def run(self):
        count = 0
        while not self.is_stopping:
            count += 1
            mesh = self.folder / f"{self.name}-{count}.stl"
            mesh.write_bytes(box(*self.random.choice(SHAPES)))
            out = self.call("submit", str(mesh), "--edge-length", str(EDGE_LENGTH), "--format", "stl",
                            "--format", "vtu", *(["--skip-cache"] if self.random.random() < 0.9 else []))
            mesh.unlink()
            for name in re.findall(r"^tenants/\S+$", out, re.MULTILINE):
                self.acknowledged.append(name)
                choice = self.random.random()
                if choice < 0.1:
                    self.call("cancel", name)
                elif choice < 0.5:
                    self.call("watch", name)

    def call(self, *words):
        self.process = subprocess.Popen([*self.command, *words], stdout=subprocess.PIPE,
                                        stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL, text=True)
        return self.process.communicate()[0]

    def kill(self):
        if self.process and self.process.poll() is None:
            self.process.kill()
            return True
        return False


def kill_at_random(arguments, server, clients):
    """Kills until there were enough. Returns how many of each kind."""
    dice = random.Random(arguments.seed)
    kills = collections.Counter()
    while sum(kills.values()) < arguments.kills:
        time.sleep(dice.uniform(0.05, 0.5))
        choice = dice.random()
        if choice < SHARE_OF_SERVER:
            server.kill()
            kills["server"] += 1
        elif choice < SHARE_OF_SERVER + SHARE_OF_WORKERS:
            workers = server.workers()
            if workers:
                try:
                    os.kill(dice.choice(workers), signal.SIGKILL)
                    kills["worker"] += 1
                except ProcessLookupError:
                    pass
        elif dice.choice(clients).kill():
            kills["client"] += 1
    return kills


def wait_until_done(arguments, server):
    """Waits for the queue to run dry."""
    left, last_change = math.inf, time.monotonic()
    while time.monotonic() < last_change + LONGEST_PAUSE:
        listed = subprocess.run(
            [arguments.remesh, "--server", server.address, "--json", "list", "--state", "queued", "--state",
             "running", "--state", "cancelling"], stdout=subprocess.PIPE, text=True, check=True).stdout
        now_left = sum('"name"' in line for line in listed.splitlines())
        if not now_left:
            return
        if now_left < left:
            left, last_change = now_left, time.monotonic()
        time.sleep(0.2)
    raise RuntimeError("jobs don't come to an end")


def check_jobs(database, acknowledged, problems):
    """One end each, events without gaps. Returns the states."""
    states = collections.Counter()
    known = {f"tenants/{tenant}/jobs/{id}": (number, state) for tenant, id, number, state in
             database.execute("SELECT tenant, id, number, state FROM jobs")}
    for name in acknowledged:
        if name not in known:
            problems.append(f"lost: {name}")
    for name, (number, state) in known.items():
        states[state] += 1
        events = list(database.execute(
            "SELECT sequence, state FROM events WHERE job = ? ORDER BY sequence", (number,)))
        ends = [end for _, end in events if end in TERMINAL]
        if ends != [state]:
            problems.append(f"{name} is {state} and came to these ends: {ends}")
        if [sequence for sequence, _ in events] != list(range(1, len(events) + 1)):
            problems.append(f"{name} misses events")
    return states


def check_files(database, data, problems):
    """Files and records are the same, and the bytes have their digests."""
    recorded = {(tenant, sha): size for tenant, sha, size in
                database.execute("SELECT tenant, sha256, size FROM artifacts")}
    found = set()
    for file in data.glob("tenants/*/artifacts/*"):
        key = (file.parts[-3], file.name)
        found.add(key)
        content = file.read_bytes()
        if key not in recorded:
            problems.append(f"orphan: {file}")
        elif hashlib.sha256(content).hexdigest() != file.name or len(content) != recorded[key]:
            problems.append(f"damaged: {file}")
    problems.extend(f"missing: {key}" for key in recorded.keys() - found)
    for number, in database.execute("SELECT number FROM jobs WHERE state = 'succeeded'"):
        outputs = database.execute("SELECT COUNT(*) FROM job_artifacts WHERE job = ? AND role = 'output'",
                                   (number,)).fetchone()[0]
        if outputs < 3:
            problems.append(f"job {number} succeeded with {outputs} outputs")
    previews = database.execute("SELECT COUNT(*) FROM job_artifacts WHERE role = 'preview'").fetchone()[0]
    if previews:
        problems.append(f"{previews} previews are left of jobs that ended")


def check_meshes(database, problems):
    """Jobs of one input made the same meshes; their reports tell times, and differ."""
    outputs = collections.defaultdict(list)
    for number, input in database.execute(
            "SELECT j.number, a.sha256 FROM jobs AS j JOIN job_artifacts AS a ON a.job = j.number "
            "WHERE j.state = 'succeeded' AND a.role = 'input'").fetchall():
        outputs[input].append({sha for sha, in database.execute(
            "SELECT sha256 FROM job_artifacts WHERE job = ? AND role = 'output'", (number,))})
    for input, made in outputs.items():
        if len(set.intersection(*made)) < 2:
            problems.append(f"jobs of input {input} made different meshes")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--remeshd", required=True)
    parser.add_argument("--remesh", required=True)
    parser.add_argument("--kills", type=int, default=int(os.environ.get("REMESH_TEST_KILLS", "200")))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--keep", action="store_true", help="leave the data directory behind")
    arguments = parser.parse_args()

    folder = pathlib.Path(tempfile.mkdtemp(prefix="remesh-chaos-"))
    server = Server(arguments.remeshd, folder, "--workers", "2", "--checkpoint-interval", "0")
    clients = [Client(arguments, server, folder, arguments.seed * 1000 + i) for i in range(arguments.clients)]
    for client in clients:
        client.start()
    kills = kill_at_random(arguments, server, clients)
    for client in clients:
        client.is_stopping = True
    for client in clients:
        client.join()
    wait_until_done(arguments, server)
    server.stop()
    server.start()  # cleans up
    server.stop()

    problems = []
    database = sqlite3.connect(f"file:{folder}/data/remesh.sqlite?mode=ro", uri=True)
    acknowledged = [name for client in clients for name in client.acknowledged]
    states = check_jobs(database, acknowledged, problems)
    check_files(database, folder / "data", problems)
    check_meshes(database, problems)
    problems.extend(f"left over: {file}" for file in (folder / "data").glob("tenants/*/checkpoints/*"))
    if database.execute("PRAGMA integrity_check").fetchone()[0] != "ok":
        problems.append("the database is damaged")
    if not states["succeeded"]:
        problems.append("no job succeeded: nothing was tested")
    database.close()

    resumed = (folder / "server.log").read_text(errors="replace").count("event=job_resumed")
    waits = sorted(server.recoveries)
    print(json.dumps({
        "kills": dict(kills), "acknowledged": len(acknowledged), "jobs": dict(states), "resumed": resumed,
        "recovery_seconds_median": round(waits[len(waits) // 2], 3),
        "recovery_seconds_longest": round(math.ceil(waits[-1] * 1000) / 1000, 3),
        "problems": len(problems)}))
    for problem in problems[:50]:
        print(problem, file=sys.stderr)
    if arguments.keep or problems:
        print(f"kept {folder}", file=sys.stderr)
    else:
        shutil.rmtree(folder)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
