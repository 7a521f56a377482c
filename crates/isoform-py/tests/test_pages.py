"""Runs the Python of docs/python.md, and the examples of the package's own pages."""

import contextlib
import doctest
import io
import os
import re
import tempfile
import unittest
import warnings
from pathlib import Path

import isoform

PAGE = Path(__file__).resolve().parents[3] / "docs/python.md"


class Pages(unittest.TestCase):
    def test_the_page(self):
        blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)
        self.assertGreater(len(blocks), 4)
        names = {}
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
                    warnings.simplefilter("error", isoform.UncertifiedWarning)
                    for block in blocks:
                        exec(compile(block, str(PAGE), "exec"), names)
                written = {p.name for p in Path(folder).iterdir()}
            finally:
                os.chdir(before)
        self.assertLessEqual({"ball.msh", "sphere.step", "page.html", "picture.png"}, written)

    def test_examples(self):
        flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        found = doctest.testmod(isoform, optionflags=flags)
        self.assertEqual(found.failed, 0)
        self.assertGreater(found.attempted, 20)


if __name__ == "__main__":
    unittest.main()
