"""Runs the client of docs/python.md as it stands there, against a real server.

usage: run_docs_client.py REPOSITORY REMESHD
"""

import os
import re
import subprocess
import sys
import tempfile

import moody
from serving import serving


def block(text, language):
    """The first code block in a language."""
    return re.search(rf"```{language}\n(.*?)```", text, re.DOTALL).group(1)


def main(repository, remeshd):
    with open(os.path.join(repository, "docs", "python.md"), encoding="utf-8") as file:
        text = file.read()
    with tempfile.TemporaryDirectory() as folder:
        os.symlink(os.path.join(repository, "proto"), os.path.join(folder, "proto"))
        commands = block(text, "sh").split("\n", 1)[1]  # The packages are there already.
        subprocess.run(["bash", "-e", "-c", commands], cwd=folder, check=True)
        with open(os.path.join(folder, "client.py"), "w", encoding="utf-8") as file:
            file.write(block(text, "python"))
        with serving(remeshd, folder) as (server, _), moody.before(server) as address:
            mesh = os.path.join(repository, "tests", "data", "aorta.stl")
            for _ in range(2):  # The second time nothing has to be uploaded.
                result = subprocess.run(
                    [sys.executable, "client.py", address, mesh, "5", "aorta.vtu"], cwd=folder,
                    check=True, stdout=subprocess.PIPE, text=True)
                quality = re.search(r"\d+ tetrahedra, mean quality (\S+)", result.stdout).group(1)
                assert 0.85 < float(quality) <= 1.0, result.stdout
            with open(os.path.join(folder, "aorta.vtu"), "rb") as file:
                assert b"UnstructuredGrid" in file.read(500)


if __name__ == "__main__":
    main(os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2]))
