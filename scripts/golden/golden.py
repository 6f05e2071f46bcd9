"""Code shared by the scripts in this folder: the output folder and the format of the numbers."""

import json
import sys


def write(name, value):
    """Write value as <folder given on the command line>/<name>; floats read back exactly."""
    folder = sys.argv[1] if len(sys.argv) > 1 else "tests/golden"
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    with open(f"{folder}/{name}", "w") as f:
        f.write(text + "\n")
