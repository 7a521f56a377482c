"""Tests of meshes in blocks."""

import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import isoform
from isoform import IsoformError, distributed

# A plate with a hole, across which the sides of blocks lie.
PLATE = """plate(x[3], a[1]) {
  plate = (1 - x[1]^2 / 4) & (1 - x[2]^2) & (0.25 - x[3]^2) & (x[1]^2 + x[2]^2 - 0.3);
}"""


class Blocks(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = Path(place.name)
        self.plate = isoform.Model(PLATE)

    def made(self, name, **options):
        folder = self.folder / name
        folder.mkdir()
        made = distributed.mesh_blocks(
            self.plate, (2, 2, 1), folder / "plate.pvtu", size=0.15, **options
        )
        return made, {p.name: p.read_bytes() for p in folder.iterdir()}

    def test_files_and_certificate(self):
        told = []
        made, files = self.made("here", progress=lambda step, done: told.append((step, done)))
        pieces = [f"plate_{k}.vtu" for k in range(4)]
        self.assertEqual(sorted(files), ["plate.pvtu", *pieces])
        grid = ElementTree.parse(made.path).getroot()
        self.assertEqual([p.get("Source") for p in grid.iter("Piece")], pieces)
        whole = made.certificate
        self.assertTrue(whole["ok"], made.to_dict())
        self.assertGreater(whole["shared_faces"], 0)
        self.assertEqual(sum(b["figures"]["tets"] for b in made.blocks), whole["tets"])
        one = isoform.mesh(self.plate, size=0.15).certificate
        self.assertAlmostEqual(whole["volume"], one["volume"], delta=0.002 * one["volume"])
        self.assertAlmostEqual(whole["area"], one["area"], delta=0.002 * one["area"])
        self.assertEqual(list(dict.fromkeys(step for step, _ in told))[-1], "certificates")

    def test_processes_give_the_same_bytes(self):
        self.assertEqual(self.made("here")[1], self.made("there", processes=2)[1])

    def test_what_cannot_be(self):
        out = self.folder / "plate.pvtu"
        for blocks, path in [((0, 1, 1), out), ((1, 1, 900), out), ((1, 1), out),
                             ((1, 1, 1), self.folder / "plate.vtu"),
                             ((1, 1, 1), self.folder / "none" / "plate.pvtu")]:
            with self.assertRaises(IsoformError, msg=blocks):
                distributed.mesh_blocks(self.plate, blocks, path, size=0.15)
        with self.assertRaises(IsoformError):
            distributed.mesh_blocks(self.plate, (1, 1, 1), out, engine="none")
        with self.assertRaises(IsoformError) as stopped:
            distributed.mesh_blocks(
                self.plate, (2, 1, 1), out, size=0.15, progress=lambda step, done: False
            )
        self.assertEqual(stopped.exception.code, "time-limit")
        self.assertEqual(list(self.folder.iterdir()), [])


if __name__ == "__main__":
    unittest.main()
