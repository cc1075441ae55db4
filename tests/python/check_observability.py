"""Compares what Grafana, the alerts and docs/operations.md ask for with what a real server tells.

usage: check_observability.py REPOSITORY REMESHD REMESH
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request

from serving import serving

# Prometheus adds these to what it reads.
OF_PROMETHEUS = {"job", "instance", "le"}
METRIC = re.compile(r"\b((?:remesh|process)_[a-z_]+)(?:\{([^}]*)\})?")


def samples(text):
    """{name: {label: values}} of a Prometheus text."""
    found = {}
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, labels = re.match(r"([a-zA-Z_:][\w:]*)(?:\{(.*)\})? ", line).groups()
            known = found.setdefault(name, {})
            for label, value in re.findall(r'(\w+)="([^"]*)"', labels or ""):
                known.setdefault(label, set()).add(value)
    return found


def metrics_of(remeshd, remesh, mesh):
    """What a server tells that has made a mesh and refused another."""
    with tempfile.TemporaryDirectory() as folder, serving(remeshd, folder) as (grpc, http):
        subprocess.run([remesh, "--server", grpc, "--quiet", "run", mesh, "--edge-length", "8",
                        "-o", os.path.join(folder, "mesh.vtu")], check=True)
        while True:  # What ended is counted a moment later.
            with urllib.request.urlopen(f"http://{http}/metrics") as response:
                found = samples(response.read().decode())
            if "remesh_attempt_duration_seconds_count" in found:
                return found
            time.sleep(0.1)


def check_expression(expression, told, where):
    """Every metric that it names exists, with those labels and values."""
    for name, selectors in METRIC.findall(expression):
        assert name in told, f"{where}: no metric {name}"
        for label, operator, values in re.findall(r'(\w+)\s*(=~|!~|!=|=)\s*"([^"]*)"', selectors):
            if label in OF_PROMETHEUS:
                continue
            assert label in told[name], f"{where}: {name} has no label {label}"
            for value in values.split("|") if "~" in operator else [values]:
                assert value in told[name][label], f"{where}: {name} is never {label}={value}"


def check_grafana(path, told):
    with open(path, encoding="utf-8") as file:
        panels = json.load(file)["panels"]
    cells = set()
    for panel in panels:
        title = panel["title"]
        assert panel["fieldConfig"]["defaults"]["unit"], f"{title}: no unit"
        for target in panel["targets"]:
            check_expression(target["expr"], told, title)
            by = re.search(r"\bby \(([^)]*)\)", target["expr"])
            labels = {name.strip() for name in by.group(1).split(",")} if by else set()
            names = [name for name, _ in METRIC.findall(target["expr"])]
            for label in labels - OF_PROMETHEUS:
                assert any(label in told[name] for name in names), f"{title}: by {label}"
        at = panel["gridPos"]
        own = {(x, y) for x in range(at["x"], at["x"] + at["w"])
               for y in range(at["y"], at["y"] + at["h"])}
        assert not own & cells and at["x"] + at["w"] <= 24, f"{title}: covers another panel"
        cells |= own
    assert len({panel["id"] for panel in panels}) == len(panels), "two panels have one id"


def check_alerts(path, handbook, told):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    check_expression(text, told, "alerts")
    for alert in re.findall(r"alert: (\w+)", text):
        assert f"`{alert}`" in handbook, f"docs/operations.md doesn't say what to do on {alert}"


def check_handbook(text, told):
    families = {re.sub(r"_(bucket|sum|count)$", "", name) for name in told}
    listed = set(re.findall(r"`((?:remesh|process)_[a-z_]+)`", text))
    assert families <= listed, f"not in docs/operations.md: {families - listed}"
    assert listed <= families, f"only in docs/operations.md: {listed - families}"


def main(repository, remeshd, remesh):
    told = metrics_of(remeshd, remesh, os.path.join(repository, "tests", "data", "aorta.stl"))
    observability = os.path.join(repository, "docker", "observability")
    with open(os.path.join(repository, "docs", "operations.md"), encoding="utf-8") as file:
        handbook = file.read()
    check_grafana(os.path.join(observability, "grafana", "dashboards", "remesh.json"), told)
    check_alerts(os.path.join(observability, "alerts.yml"), handbook, told)
    check_handbook(handbook, told)


if __name__ == "__main__":
    main(*map(os.path.abspath, sys.argv[1:4]))
