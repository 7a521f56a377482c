"""Tests of fits of clouds in chunks."""

import pickle
import signal
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import isoform
from isoform import IsoformError
from isoform.distributed import fit_large
from test_package import BALL, on_ball


class Chunks(unittest.TestCase):
    def setUp(self):
        self.ball = isoform.Model(BALL)

    def agree(self, chunks, whole, within=1e-9):
        found = fit_large(chunks, self.ball)
        self.assertEqual(list(found.values), list(whole.values))
        for name, value in whole.values.items():
            self.assertAlmostEqual(found.values[name], value, delta=within)
            self.assertAlmostEqual(found.sd[name] / whole.sd[name], 1, delta=1e-6)
        self.assertAlmostEqual(found.rms, whole.rms, delta=within)
        self.assertEqual(found.reasons, whole.reasons)
        counts = [(d.to_dict()["n_points"], d.to_dict()["n_outliers"]) for d in (found, whole)]
        self.assertEqual(*counts)
        return found

    def test_arrays_files_and_functions_are_chunks(self):
        points = on_ball(3000)
        whole = isoform.fit(points, self.ball)
        parts = np.array_split(points, 5)
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / f"{k}.xyz" for k in range(5)]
            for file, part in zip(files, parts):
                np.savetxt(file, part, fmt="%.17g")
            for chunks in (parts, files, [lambda p=p: p for p in parts], iter(parts)):
                found = self.agree(chunks, whole)
        self.assertEqual(found.deviation.shape, (3000,))
        np.testing.assert_array_equal(found.points, whole.points)
        self.assertEqual(pickle.loads(pickle.dumps(found)).values, found.values)

    def test_more_points_than_are_gathered(self):
        points = on_ball(230_000) + [2, 0, 0]
        points += np.random.default_rng(1).normal(scale=0.01, size=points.shape)
        # Stray points, and points that come twice, in other chunks.
        points[::500] += 0.4
        points[100_000:100_100] = points[:100]
        whole = isoform.fit(points, self.ball)
        parts = [points[:7], points[7:7], points[7:90_000], points[90_000:]]
        found = self.agree(parts, whole)
        self.assertEqual(found.points.shape, (200_000, 3))
        told = [d.to_dict()["warnings"] for d in (found, whole)]
        self.assertEqual(*told)
        # Neither chunks nor the order of points decide.
        points[:90_000] = points[np.random.default_rng(2).permutation(90_000)]
        again = self.agree(np.array_split(points, 9), whole)
        self.assertEqual(again.to_dict()["n_used"], found.to_dict()["n_used"])

    def test_a_wrong_chunk_is_named(self):
        good = on_ball(100)
        broken = good.copy()
        broken[3, 1] = np.nan

        def fails():
            raise KeyError("no such tile")

        for chunk, code, said in [
            ("none.ply", "file-unreadable", "chunk 1: "),
            (broken, "not-finite", "chunk 1: point 3 "),
            (good[:, :2], "shape", "chunk 1: points are (n, 3)"),
        ]:
            with self.assertRaises(IsoformError) as raised:
                fit_large([good, chunk], self.ball)
            self.assertEqual(raised.exception.code, code)
            self.assertTrue(str(raised.exception).startswith(said), raised.exception)
        with self.assertRaises(KeyError):
            fit_large([good, fails], self.ball)
        sizes = iter(range(100, 200))
        with self.assertRaises(IsoformError) as raised:
            fit_large([good, lambda: on_ball(next(sizes))], self.ball)
        self.assertEqual(raised.exception.code, "changed")
        self.assertIn("chunk 1: 101 points, where there were 100", str(raised.exception))
        for chunks in ([], [np.empty((0, 3))]):
            with self.assertRaises(IsoformError) as raised:
                fit_large(chunks, self.ball)
            self.assertEqual(raised.exception.code, "no-points")
        for chunks in (good, "scan.ply"):
            with self.assertRaises(TypeError):
                fit_large(chunks, self.ball)

    def test_options_are_those_of_a_fit(self):
        chunks = np.array_split(on_ball(500), 3)
        self.assertEqual(fit_large(chunks, self.ball, fixed={"radius": 1.1}).values["radius"], 1.1)
        for wrong in ({"engine": "spark"}, {"colour": "red"}, {"pose": "askew"}):
            with self.assertRaises(IsoformError):
                fit_large(chunks, self.ball, **wrong)
        with self.assertRaises(TypeError):
            fit_large(chunks, BALL)

    def test_an_exception_while_chunks_are_read_ends_the_fit(self):
        asked = []

        def slow():
            asked.append(time.monotonic())
            time.sleep(0.2)
            return on_ball(100)

        timer = threading.Timer(0.5, signal.raise_signal, [signal.SIGINT])
        timer.start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            fit_large([slow] * 200, self.ball)
        self.assertLess(time.monotonic() - start, 2.5)
        time.sleep(0.5)
        count = len(asked)
        time.sleep(0.5)
        self.assertEqual(len(asked), count)

    def test_progress_is_told(self):
        phases = []
        fit_large([on_ball(800)], self.ball, progress=lambda phase, done: phases.append(phase))
        self.assertIn("search", phases)


if __name__ == "__main__":
    unittest.main()
