"""Runs the notebooks of examples/notebooks: they end, and print what they were saved with."""

import unittest
from pathlib import Path

import nbclient
import nbformat

FOLDER = Path(__file__).resolve().parents[3] / "examples/notebooks"


def printed(cell):
    """The texts that a cell prints; a kernel may send one stream in several pieces."""
    texts = []
    stream = None
    for output in cell.get("outputs", []):
        data = output.get("data", {})
        name = output.get("name")
        if name is not None and name == stream:
            texts[-1] += output["text"]
        elif "image/png" in data:
            texts.append("a picture")
        else:
            texts.append(output.get("text") or data.get("text/plain", ""))
        stream = name
    return texts


class Notebooks(unittest.TestCase):
    def test_they_print_what_they_were_saved_with(self):
        files = sorted(FOLDER.glob("*.ipynb"))
        self.assertEqual(len(files), 5)
        for file in files:
            with self.subTest(file.name):
                saved = nbformat.read(file, as_version=4)
                nbformat.validate(saved)
                again = nbformat.from_dict(saved)
                resources = {"metadata": {"path": str(FOLDER)}}
                nbclient.NotebookClient(again, timeout=300, resources=resources).execute()
                for before, now in zip(saved.cells, again.cells):
                    self.assertEqual(printed(before), printed(now), now.source)

    def test_pictures_say_what_they_show(self):
        for file in sorted(FOLDER.glob("*.ipynb")):
            pictures = 0
            for cell in nbformat.read(file, as_version=4).cells:
                if "a picture" in printed(cell):
                    pictures += 1
                    self.assertTrue(cell.metadata.get("alt"), f"{file.name}: {cell.source}")
            self.assertGreater(pictures, 0, file.name)


if __name__ == "__main__":
    unittest.main()
