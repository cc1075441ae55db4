#!/usr/bin/env python3
"""Server and worker processes, as an operator meets them.

usage: processes_test.py REMESHD REMESH
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from service_processes import Server, box, children_of

REMESHD, REMESH = sys.argv[1:3]
DEADLINE = 300.0  # for slow machines; none of it takes so long
# A minute of work, for jobs that are ended from outside; a second or two; and a tenth of that.
ENDLESS_JOB = ("--edge-length", "0.02", "--surface-only")
LONG_JOB = ("--edge-length", "0.05", "--surface-only")
SHORT_JOB = ("--edge-length", "0.5", "--surface-only")


class Processes(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="remesh-processes-"))
        self.mesh = self.folder / "box.stl"
        self.mesh.write_bytes(box(2.0, 1.5, 1.0))
        self.server = None

    def tearDown(self):
        if self.server and self.server.process.poll() is None:
            self.server.process.kill()
            self.server.process.wait()
        if self.server:
            self.server.log.close()
        # Workers of a killed server may be just ending, and take files of theirs away.
        while os.path.exists(self.folder):
            shutil.rmtree(self.folder, ignore_errors=True)

    def serve(self, *flags, log_level="warn"):
        self.server = Server(REMESHD, self.folder, "--workers", "1", "--log-level", log_level, *flags)

    def client(self, *words):
        return [REMESH, "--server", self.server.address, *words]

    def submit(self, *options):
        return subprocess.run(self.client("submit", str(self.mesh), "--format", "stl", *options),
                              stdout=subprocess.PIPE, text=True, check=True).stdout.strip()

    def watch(self, job):
        return subprocess.run(self.client("watch", job), stderr=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL, timeout=DEADLINE).returncode

    def show(self, job):
        return json.loads(subprocess.run(self.client("--json", "show", job), stdout=subprocess.PIPE,
                                         check=True).stdout)

    def wait_for_progress(self, job, attempt=1, iteration=1):
        """Waits until a worker is so far in the midst of an attempt, by the events that a watch brings."""
        with subprocess.Popen(self.client("--json", "watch", job), stdout=subprocess.PIPE, text=True) as watch:
            now = 0
            for line in watch.stdout:
                event = json.loads(line)
                if event.get("sequence", 0) and "snapshot" in event:
                    now = event["snapshot"].get("attempt", 0)
                if now == attempt and event.get("sample", {}).get("iteration", 0) >= iteration:
                    break
            else:
                self.fail("the job ended before it got so far")
            watch.kill()

    def checkpoints(self):
        """Names of the jobs whose runs have saved where they stand."""
        folder = self.folder / "data" / "tenants" / "default" / "checkpoints"
        return [file.name for file in folder.iterdir() if "." not in file.name] if folder.exists() else []

    def wait_until_checkpoints_are_gone(self):
        """Takes them away who ran the job, once everybody knows that it ended."""
        end = time.monotonic() + DEADLINE
        while self.checkpoints():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.01)

    def surface_of(self, job):
        """Digest of the mesh that a job made."""
        return self.show(job)["result"]["outputs"][0]["digest"]["sha256"]

    def kill_worker(self):
        workers = self.server.workers()
        self.assertEqual(len(workers), 1)
        os.kill(workers[0], signal.SIGKILL)

    def test_a_killed_worker_costs_one_attempt_and_no_connection(self):
        self.serve()
        job = self.submit(*LONG_JOB)
        with subprocess.Popen(self.client("--json", "watch", job), stdout=subprocess.PIPE, text=True) as watch:
            for line in watch.stdout:
                if "sample" in json.loads(line):
                    break
            self.kill_worker()
            events = [json.loads(line) for line in watch.stdout]

        self.assertEqual(watch.returncode, 0)
        self.assertEqual(self.show(job)["attempt"], 2)
        self.assertIsNone(self.server.process.poll())
        sequences = [int(event["sequence"]) for event in events if event.get("sequence")]
        self.assertEqual(sequences, sorted(set(sequences)))

    def test_a_job_that_crashes_two_workers_is_quarantined(self):
        self.serve()
        job = self.submit(*ENDLESS_JOB)
        for attempt in (1, 2):
            self.wait_for_progress(job, attempt)
            self.kill_worker()

        self.assertEqual(self.watch(job), 4)
        self.assertIn("QUARANTINED", self.show(job)["state"])
        other = self.submit(*SHORT_JOB)
        self.assertEqual(self.watch(other), 0)

    def test_a_cancel_reaches_the_worker_process(self):
        self.serve()
        job = self.submit(*ENDLESS_JOB)
        self.wait_for_progress(job)
        subprocess.run(self.client("cancel", job), check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        self.assertEqual(self.watch(job), 5)
        shown = self.show(job)
        self.assertIn("CANCELLED", shown["state"])

    def test_sigterm_gives_a_running_job_back_and_the_next_server_finishes_it(self):
        self.serve()
        job = self.submit(*LONG_JOB)
        self.wait_for_progress(job)
        self.server.stop()
        self.assertEqual(list((self.folder / "data" / "workers").iterdir()), [])
        self.server.start()

        self.assertEqual(self.watch(job), 0)
        self.assertEqual(self.show(job)["attempt"], 1)

    def test_a_run_goes_on_from_its_checkpoint_to_the_same_bytes(self):
        self.serve("--checkpoint-interval", "0", log_level="info")
        whole = self.submit(*LONG_JOB)
        self.assertEqual(self.watch(whole), 0)
        self.wait_until_checkpoints_are_gone()

        job = self.submit(*LONG_JOB, "--skip-cache")
        self.wait_for_progress(job, iteration=10)
        self.assertEqual(self.checkpoints(), [job.split("/")[-1]])
        self.kill_worker()
        self.assertEqual(self.watch(job), 0)
        self.assertEqual(self.show(job)["attempt"], 2)
        self.assertEqual(self.surface_of(job), self.surface_of(whole))
        self.assertIn(f"event=job_resumed job={job.split('/')[-1]}", (self.folder / "server.log").read_text())
        self.wait_until_checkpoints_are_gone()

        job = self.submit(*LONG_JOB, "--skip-cache")
        self.wait_for_progress(job)
        self.server.stop()
        self.assertEqual(self.checkpoints(), [job.split("/")[-1]])
        self.server.start()
        self.assertEqual(self.watch(job), 0)
        self.assertEqual(self.surface_of(job), self.surface_of(whole))

    def test_a_damaged_checkpoint_costs_time_and_nothing_else(self):
        self.serve("--checkpoint-interval", "0")
        job = self.submit(*LONG_JOB)
        self.wait_for_progress(job)
        self.server.stop()
        file = self.folder / "data" / "tenants" / "default" / "checkpoints" / job.split("/")[-1]
        file.write_bytes(file.read_bytes()[:-1])
        self.server.start()
        self.assertEqual(self.watch(job), 0)
        self.assertIn("event=checkpoint_unusable", (self.folder / "server.log").read_text())

    def test_a_killed_server_takes_its_workers_with_it_and_loses_no_job(self):
        self.serve()
        job = self.submit(*LONG_JOB)
        self.wait_for_progress(job)
        workers = self.server.workers()
        self.server.kill()

        self.assertEqual(self.watch(job), 0)
        end = time.monotonic() + DEADLINE
        while any(pathlib.Path(f"/proc/{worker}").exists() for worker in workers):
            self.assertLess(time.monotonic(), end)

    def test_workers_of_another_process_run_the_jobs_of_a_server_without(self):
        self.server = Server(REMESHD, self.folder, "--workers", "0", "--log-level", "warn")
        work = [REMESHD, "work", "--data-dir", self.server.data, "--threads", "1", "--log-level", "warn"]
        first = subprocess.Popen(work)
        job = self.submit(*LONG_JOB)
        self.wait_for_progress(job)
        first.kill()
        first.wait()
        second = subprocess.Popen(work)
        try:
            self.assertEqual(self.watch(job), 0)
        finally:
            second.terminate()
            self.assertEqual(second.wait(DEADLINE), 0)
        self.assertEqual(children_of(self.server.process.pid), [])

    def test_a_job_that_needs_more_memory_than_it_may_fails_and_names_the_bound(self):
        self.serve("--max-job-memory", "64")
        job = self.submit("--edge-length", "0.004")

        self.assertEqual(self.watch(job), 4)
        failure = self.show(job)["failure"]
        self.assertEqual(failure["reason"], "TOO_LARGE")
        self.assertIn("64 MiB", failure["message"])

    def test_an_address_that_cant_be_is_refused_with_the_reason(self):
        for flag, address, reason in (("--listen", "127.0.0.1:65536", "must be HOST:PORT"),
                                      ("--listen", "nonsense", "must be HOST:PORT"),
                                      ("--http", "127.0.0.1:-1", "must be HOST:PORT"),
                                      ("--listen", "unix:/nowhere/at/all", "No such file or directory"),
                                      ("--port-file", "/nowhere/at/all", "No such file or directory")):
            flags = {"--data-dir": self.folder / "data", "--listen": "127.0.0.1:0", flag: address}
            refused = subprocess.run([REMESHD, "serve", *(word for pair in flags.items() for word in pair)],
                                     stderr=subprocess.PIPE, text=True, timeout=DEADLINE)
            self.assertEqual(refused.returncode, 1, address)
            self.assertIn(reason, refused.stderr)

    def test_a_second_server_on_the_directory_refuses(self):
        self.serve()
        second = subprocess.run([REMESHD, "serve", "--data-dir", self.server.data, "--listen", "127.0.0.1:0"],
                                stderr=subprocess.PIPE, text=True, timeout=DEADLINE)
        self.assertEqual(second.returncode, 1)
        self.assertIn("in use by another server", second.stderr)
        self.assertEqual(self.watch(self.submit(*SHORT_JOB)), 0)

    def test_a_damaged_database_is_refused_and_left_as_it_is(self):
        self.serve()
        self.assertEqual(self.watch(self.submit(*SHORT_JOB)), 0)
        self.server.stop()
        for name in ("remesh.sqlite", "access.sqlite"):
            file = self.server.data / name
            whole = file.read_bytes()
            damaged = whole[:4096] + bytes(len(whole) - 4096)
            file.write_bytes(damaged)

            again = subprocess.run(
                [REMESHD, "serve", "--data-dir", self.server.data, "--listen", "127.0.0.1:0"],
                stderr=subprocess.PIPE, text=True, timeout=DEADLINE)
            self.assertEqual(again.returncode, 1)
            self.assertIn(f"{name} is damaged", again.stderr)
            self.assertEqual(file.read_bytes(), damaged)
            file.write_bytes(whole)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
