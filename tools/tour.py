"""Runs a notebook in an empty folder and writes it back with what its cells show."""

import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def run(notebook: nbformat.NotebookNode) -> None:
    """Run all cells; an exception in a cell is raised here."""
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=300, resources=resources, record_timing=False).execute()


def main() -> None:
    path = Path(sys.argv[1])
    notebook = nbformat.read(path, as_version=4)
    run(notebook)
    # What differs from machine to machine is not kept.
    notebook.metadata["language_info"] = {"name": "python"}
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            # The text beside a picture only says what kind of object it is.
            data = output.get("data", {})
            if "image/png" in data:
                data.pop("text/plain", None)
    nbformat.write(notebook, path)
    print(f"{path.name}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
