"""What tests of whole processes need: a server that is started and killed, and a mesh."""

import pathlib
import socket
import struct
import subprocess
import threading
import time

LONGEST_START = 60.0


def box(x, y, z):
    """Binary STL of a box with its corner in the origin."""
    corners = [(i & 1 and x or 0.0, i & 2 and y or 0.0, i & 4 and z or 0.0) for i in range(8)]
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    facets = [(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(c for i in f for c in corners[i]), 0) for f in facets)
    return bytes(80) + struct.pack("<I", len(facets)) + body


def children_of(process_id):
    """Process ids of a process's children; none if it's gone."""
    try:
        lists = [(task / "children").read_text()
                 for task in pathlib.Path(f"/proc/{process_id}/task").iterdir()]
        return sorted(int(word) for text in lists for word in text.split())
    except OSError:
        return []


class Server:
    """A remeshd on a folder."""

    def __init__(self, program, folder, *flags):
        self.program = program
        self.data = folder / "data"
        self.address = f"unix:{folder}/s"
        self.flags = flags
        self.log = open(folder / "server.log", "ab")
        self.process = None
        self.lock = threading.Lock()
        self.recoveries = []
        self.start()

    def start(self):
        """Starts it and waits until it serves."""
        begin = time.monotonic()
        self.process = subprocess.Popen(
            [self.program, "serve", "--data-dir", self.data, "--listen", self.address, "--threads", "1",
             *self.flags], stdout=self.log, stderr=self.log)
        while not self.is_listening():
            if self.process.poll() is not None:
                raise RuntimeError(f"remeshd ended with {self.process.returncode}; see server.log")
            if time.monotonic() - begin > LONGEST_START:
                raise RuntimeError("remeshd doesn't serve")
            time.sleep(0.005)
        self.recoveries.append(time.monotonic() - begin)

    def is_listening(self):
        """Whether it takes connections, which is the last thing that it begins with."""
        with socket.socket(socket.AF_UNIX) as connection:
            return connection.connect_ex(self.address.removeprefix("unix:")) == 0

    def kill(self):
        """Kills it as nobody may and starts it again."""
        with self.lock:
            self.process.kill()
            self.process.wait()
            self.start()

    def stop(self):
        """Ends it as an operator does."""
        with self.lock:
            self.process.terminate()
            if self.process.wait(timeout=30) != 0:
                raise RuntimeError("remeshd didn't end as it should")

    def workers(self):
        """Process ids of its worker processes."""
        return children_of(self.process.pid)
