"""Tests of fleets on local processes."""

import concurrent.futures
import json
import os
import signal
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import isoform
from isoform import IsoformError, distributed

try:
    import pyarrow.dataset
except ImportError:
    pyarrow = None
from test_package import BALL, on_ball


@unittest.skipIf(pyarrow is None, "pyarrow is not installed")
class Fleet(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.addCleanup(self.place.cleanup)
        self.folder = Path(self.place.name)
        self.scans = [self.folder / f"scan{i}.xyz" for i in range(5)]
        for i, path in enumerate(self.scans):
            np.savetxt(path, on_ball(300, i))
        self.ball = isoform.Model(BALL)
        self.out = self.folder / "out"

    def rows(self):
        rows = pyarrow.dataset.dataset(self.out, format="parquet").to_table().to_pylist()
        self.assertEqual(len(rows), len({r["source"] for r in rows}))
        return {Path(r["source"]).name: r for r in rows}

    def test_rows_are_fits(self):
        none = self.folder / "none.ply"
        distributed.fit_many([*self.scans, none], self.ball, out=self.out, processes=2)
        rows = self.rows()
        self.assertFalse(rows["none.ply"]["ok"])
        self.assertIn("unreadable", rows["none.ply"]["error"])
        for path in self.scans:
            row, fit = rows[path.name], isoform.fit(isoform.read_points(path), self.ball)
            self.assertEqual({k: row[k] for k in fit.values}, fit.values)
            self.assertEqual(json.loads(row["json"])["rms"], fit.rms)

    def test_executors_do_the_work(self):
        with concurrent.futures.ThreadPoolExecutor(2) as executor:
            distributed.fit_many(self.scans, self.ball, engine=executor, out=self.out)
            chunks = [np.loadtxt(path) for path in self.scans]
            large = distributed.fit_large(chunks, self.ball, engine=executor)
            made = distributed.mesh_blocks(
                self.ball, (2, 1, 1), self.folder / "ball.pvtu", executor, size=0.5, params=[0, 1]
            )
        rows = self.rows()
        for path in self.scans:
            fit = isoform.fit(isoform.read_points(path), self.ball)
            self.assertEqual(rows[path.name]["radius"], fit.values["radius"])
        whole = isoform.fit(np.concatenate(chunks), self.ball)
        self.assertAlmostEqual(large.values["radius"], whole.values["radius"], places=9)
        self.assertTrue(made.certificate["ok"])

    def test_a_killed_worker_loses_nothing(self):
        killed = []

        def kill():
            end = time.monotonic() + 30
            while not killed and time.monotonic() < end:
                for task in Path("/proc/self/task").glob("*/children"):
                    children = task.read_text().split()
                    if children:
                        os.kill(int(children[0]), signal.SIGKILL)
                        killed.append(children[0])
                        break
                time.sleep(0.01)

        if not Path("/proc/self/task").exists():
            self.skipTest("no /proc")
        thread = threading.Thread(target=kill)
        thread.start()
        distributed.fit_many(self.scans, self.ball, out=self.out, processes=2)
        thread.join()
        self.assertTrue(killed)
        self.assertTrue(all(row["ok"] for row in self.rows().values()))

    def test_resume(self):
        distributed.fit_many(self.scans[:2], self.ball, out=self.out, processes=1)
        for path in self.scans[:2]:
            path.unlink()
        distributed.fit_many(self.scans, self.ball, out=self.out, processes=1)
        self.assertTrue(all(row["ok"] for row in self.rows().values()))
        # Rows of other options are made anew: the files are gone.
        options = {"bounds": {"radius": (0.1, 9)}}
        distributed.fit_many(self.scans[:1], self.ball, out=self.out, processes=1, **options)
        self.assertFalse(self.rows()["scan0.xyz"]["ok"])

    def test_poses_have_columns(self):
        options = {"pose": "translate"}
        distributed.fit_many(self.scans[:1], self.ball, out=self.out, processes=1, **options)
        self.assertIn("pose_x", self.rows()["scan0.xyz"])

    def test_the_best_of_several_templates(self):
        turn, height = np.random.default_rng(3).uniform([0, -3], [2 * np.pi, 3], (2000, 2)).T
        tube = self.folder / "tube.xyz"
        np.savetxt(tube, np.c_[2 * np.cos(turn), 2 * np.sin(turn), height])
        models = [self.ball, isoform.template("cylinder")]
        models[0].name = "ball"
        options = {"bounds": {"cx": (-9, 9)}}
        distributed.fit_many([self.scans[0], tube], models, out=self.out, processes=2, **options)
        rows = self.rows()
        self.assertEqual(rows["scan0.xyz"]["template"], "ball")
        self.assertEqual(rows["tube.xyz"]["template"], "cylinder")
        self.assertIsNone(rows["scan0.xyz"]["height"])
        with self.assertRaises(IsoformError):
            distributed.fit_many([tube], [self.ball, self.ball], out=self.out)
        with self.assertRaises(TypeError):
            distributed.fit_many([tube], [], out=self.out)

    def test_what_is_refused(self):
        for options in ({"engine": "none"}, {"speed": 3}):
            with self.assertRaises(IsoformError):
                distributed.fit_many([], self.ball, out=self.out, **options)


if __name__ == "__main__":
    unittest.main()
