"""A remeshd that serves while a test runs."""

import contextlib
import os
import subprocess
import sys
import time


def wait_for_port(file, server):
    while not os.path.exists(file):
        if server.poll() is not None:
            sys.exit("the server ended")
        time.sleep(0.02)
    with open(file, encoding="ascii") as port:
        return port.read().strip()


@contextlib.contextmanager
def serving(remeshd, folder):
    """Starts a server with its data in `folder`; gives its address and that of its HTTP port."""
    files = [os.path.join(folder, name) for name in ("grpc", "http")]
    server = subprocess.Popen(
        [remeshd, "serve", "--data-dir", os.path.join(folder, "data"),
         "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0",
         "--port-file", files[0], "--http-port-file", files[1]])
    try:
        yield ["127.0.0.1:" + wait_for_port(file, server) for file in files]
    finally:
        server.terminate()
        server.wait()
