"""Tests of the Python package beside the acceptance script: what it refuses, and how it ends."""

import contextlib
import copy
import importlib.util
import io
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import unittest
import warnings
from pathlib import Path

import numpy as np

import isoform
from isoform import IsoformError

BALL = """-- @param a[1] cx x
-- @param a[2] radius length min=0.01
my_model(x[3], a[2]) {
  array c[3]; c[1] = a[1]; c[2] = 0; c[3] = 0;
  my_model = hfSphere(x, c, a[2]);
}
"""
VALUES = {"cx": 0.5, "radius": 2.0}


def on_ball(count=400, seed=1):
    """Points of the ball with `VALUES`, with some noise."""
    rng = np.random.default_rng(seed)
    g = rng.normal(size=(count, 3))
    return [0.5, 0, 0] + (2 + 1e-3 * rng.normal(size=(count, 1))) * g / np.linalg.norm(
        g, axis=1, keepdims=True
    )


class Labels(unittest.TestCase):
    """Labels given by hand, as arrays, clouds and files."""

    def setUp(self):
        rng = np.random.default_rng(2)
        floor, wall = rng.random((2, 500, 3))
        floor[:, 2] = 0
        wall[:, 0] = 0
        wall[:, 2] += 0.05
        self.points = np.concatenate([floor, wall])
        self.labels = np.repeat([3, 8], 500)

    def test_entities_are_those_of_the_labels(self):
        found = isoform.recognize(self.points, labels=self.labels, kind={8: "plane"})
        kinds = [(e["label"], e["type"]) for e in found.entities]
        self.assertEqual(kinds, [(3, "plane"), (8, "plane")])
        self.assertEqual(list(np.unique(found.labels[:500])), [0])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "labels.ply"
            isoform.recognize(self.points, labels=list(self.labels), output=path)
            again = isoform.recognize(self.points, labels=path)
            self.assertEqual([e["label"] for e in again.entities], [0, 1])
            again = isoform.recognize(self.points, labels=isoform.read_points(path))
            self.assertEqual([e["type"] for e in again.entities], ["plane", "plane"])

    def test_what_is_no_label_is_refused(self):
        for wrong in (self.labels[:5], self.labels * 1.0, self.labels[None]):
            with self.assertRaises(IsoformError):
                isoform.recognize(self.points, labels=wrong)
        with self.assertRaises(IsoformError) as caught:
            isoform.recognize(self.points, labels=self.labels, kind={8: "torus"})
        self.assertIn("label 8", str(caught.exception))


class Pictures(unittest.TestCase):
    """What `render` draws is what the program draws, and what it refuses."""

    def setUp(self):
        self.ball = isoform.Model(BALL)

    def refused(self, **options):
        with self.assertRaises(IsoformError) as caught:
            isoform.render(self.ball, params=VALUES, **options)
        return f"{caught.exception} {caught.exception.hint}"

    def test_formats(self):
        picture = isoform.render(self.ball, params=VALUES, size=(64, 48))
        self.assertEqual(picture.data[:4], b"\x89PNG")
        self.assertEqual(int.from_bytes(picture.data[16:20], "big"), 64)
        self.assertIs(picture._repr_png_(), picture.data)
        drawing = isoform.render(self.ball, params=VALUES, size=(64, 48), svg=True)
        self.assertIn("<svg", drawing._repr_svg_())
        with tempfile.TemporaryDirectory() as folder:
            picture.save(Path(folder) / "a.png")
            with self.assertRaises(IsoformError):
                drawing.save(Path(folder) / "b.png")
            self.assertEqual([p.name for p in Path(folder).iterdir()], ["a.png"])

    def test_every_shape(self):
        scan = on_ball()
        result = isoform.fit(scan, self.ball)
        mesh = isoform.mesh(self.ball, size=0.5, params=VALUES)
        blank = isoform.render(mesh, size=(40, 30), camera=(50, 0, 0, 60, 0, 0)).data
        sphere = {"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}
        patches = isoform.parameterize({"F": "x^2 + y^2 + z^2 - 1/5"}, (2, 2), tol=1e-3)
        shapes = [scan, result, mesh, isoform.triangulate(sphere, box=2), patches]
        shapes += [isoform.brep(self.ball, params=VALUES), isoform.implicitize(scan)]
        for shape in shapes:
            with self.subTest(type(shape)):
                drawn = isoform.render(shape, size=(40, 30), no_legend=True).data
                self.assertNotEqual(drawn, blank)

    def test_deviations_of_points_beside_a_model(self):
        far = np.array([[3.5, 0, 0], [0.5, 3, 0], [0.5, 0, 3]])
        plain = isoform.render(far, self.ball, params=VALUES, size=(60, 60), color_by="none")
        colored = isoform.render(far, self.ball, params=VALUES, size=(60, 60))
        self.assertNotEqual(plain.data, colored.data)

    def test_refusals(self):
        self.assertIn("at least one pixel", self.refused(size=(0, 10)))
        self.assertIn("100000000 pixels", self.refused(size=(20_000, 20_000)))
        self.assertIn("no view is called", self.refused(view="behind"))
        self.assertIn("colours are", self.refused(color_by="taste"))
        self.assertIn("section", self.refused(section=(0, 0, 0, 1)))
        self.assertIn("leaves nothing", self.refused(section=(1, 0, 0, -99)))
        self.assertIn("six numbers", self.refused(camera=(1, 2, 3)))
        self.assertIn("background", self.refused(background=(0, 0, 300)))
        self.refused(camera=(1, 1, 1, 1, 1, 1))
        self.refused(camera=(float("nan"), 1, 1, 1, 1, 1))


class Refused(unittest.TestCase):
    """Exceptions with code, place and hint."""

    def refused(self, code, call):
        with self.assertRaises(IsoformError) as caught:
            call()
        self.assertEqual(caught.exception.code, code)
        return caught.exception

    def test_place_of_a_fault(self):
        error = self.refused("syntax", lambda: isoform.Model("f(x[3], a[1])\n{ f = x[1] + ; }"))
        self.assertEqual((error.line, error.column), (2, 14))
        self.assertTrue(str(error).startswith("2:14: "))

    def test_fault_of_a_file_names_it(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "bad.hf"
            path.write_text("f(x[3], a[1]) { f = ; }")
            error = self.refused("syntax", lambda: isoform.Model.load(path))
            self.assertIn("bad.hf:1:", str(error))

    def test_errors_travel(self):
        error = self.refused("template", lambda: isoform.template("teapot"))
        other = pickle.loads(pickle.dumps(error))
        self.assertEqual((str(other), other.code, other.hint), (str(error), error.code, error.hint))
        self.assertIn("cup", other.hint)

    def test_errors_are_those_of_python_too(self):
        ball = isoform.Model(BALL)
        with self.assertRaises(ValueError):
            isoform.mesh(ball, size=-1)
        with self.assertRaises(FileNotFoundError):
            isoform.read_points("there is no such file.ply")
        with self.assertRaises(TimeoutError):
            isoform.mesh(ball, size=0.02, params=VALUES, time_limit=0.05)
        error = self.refused("usage", lambda: isoform.mesh(ball, size=-1))
        self.assertIsInstance(pickle.loads(pickle.dumps(error)), ValueError)

    def test_arrays_that_are_no_points(self):
        ball = isoform.Model(BALL)
        for points in (np.zeros((4, 2)), np.zeros(3), np.zeros((2, 3, 1)), [], 7.0, [[1, 2]]):
            self.refused("shape", lambda: ball(points))
        for points in ("abc", None, [["a", "b", "c"]], np.zeros((2, 3), complex)):
            with self.assertRaises(TypeError):
                ball(points)
        far = np.zeros((5000, 3))
        far[4321, 2] = np.inf
        self.assertIn("4321", str(self.refused("not-finite", lambda: ball(far, VALUES))))

    def test_arguments_out_of_range(self):
        ball, points = isoform.Model(BALL), on_ball(50)
        self.refused("usage", lambda: isoform.mesh(ball, size=float("nan")))
        self.refused("usage", lambda: isoform.mesh(ball, size=0.5, order=3))
        self.refused("usage", lambda: isoform.mesh(ball, box=((0, 0, 0), (0, 1, 1))))
        self.refused("usage", lambda: isoform.mesh(ball, box=(1, 2, 3)))
        self.refused("usage", lambda: isoform.fit(points, ball, threads=0))
        self.refused("usage", lambda: isoform.fit(points, ball, time_limit=-1.0))
        self.refused("usage", lambda: isoform.fit(points, ball, method="magic"))
        self.refused("usage", lambda: isoform.fit(points, ball, start={"cx": 1.0}))
        self.refused("bounds", lambda: isoform.fit(points, ball, bounds={"cx": 3}))
        self.refused("usage", lambda: isoform.parameterize(ball, cover=True))
        self.refused("usage", lambda: isoform.fit(points, ball, seed=-1))
        self.refused("usage", lambda: isoform.fit(points, ball, threads=10**6))
        self.refused("usage", lambda: isoform.mesh(ball, angles=(80, 20)))
        self.refused("usage", lambda: isoform.parameterize(ball, (0, 2)))
        self.refused("memory", lambda: isoform.mesh(ball, size=1e-5, memory=1e30))
        with self.assertRaises(TypeError):
            isoform.fit(points, ball, progress="loud")
        with self.assertRaises(TypeError):
            isoform.fit(points, ball, seed=1.5)
        self.refused("template", lambda: isoform.mesh(BALL))
        with self.assertRaises(TypeError):
            isoform.mesh(ball, sise=1)

    def test_layers_that_cannot_be(self):
        ball = isoform.Model(BALL)

        params = {"cx": 0, "radius": 1}

        def refused(code="usage", **given):
            return str(self.refused(code, lambda: isoform.mesh(ball, 0.5, params=params, **given)))

        self.assertIn("first", refused(layers="ball"))
        self.assertIn("layers", refused(first=0.01))
        self.assertIn("empty", refused(layers=["ball", ""], first=0.01))
        self.assertIn("empty", refused(layers="", first=0.01))
        self.assertIn("'-1' for 'first", refused(layers="*", first=-1))
        self.assertIn("NaN", refused(layers="*", first=float("nan")))
        self.assertIn("growth", refused(layers="*", first=0.01, growth=float("inf")))
        self.assertIn("layers", refused(layers="*", first=0.01, layer_count=0))
        self.assertIn("number of layers", refused(layers="*", first=0.01, layer_count=101))
        self.assertIn("regions", refused(layers="*", first=0.01, regions={"core": (ball, params)}))
        self.assertIn("periodic", refused(layers="*", first=0.01, box=2, periodic="x"))
        self.assertIn("surface_only", refused(layers="*", first=0.01, surface_only=True))
        self.assertIn("order 2", refused(layers="*", first=0.01, order=2))
        with self.assertRaises(TypeError):
            isoform.mesh(ball, 0.5, layers="*", first=0.01, layer_count=2.5)

    def test_meshes_without_layers_have_no_wedges(self):
        ball = isoform.mesh(isoform.Model(BALL), 0.5, params={"cx": 0, "radius": 1})
        shapes = ball.wedges.shape, ball.quads.shape, ball.quad_parts.shape
        self.assertEqual(shapes, ((0, 6), (0, 4), (0,)))
        self.assertNotIn("layers", ball.to_dict())
        self.assertNotIn("wedges", ball.to_dict()["counts"])

    def test_no_value_is_nan_and_said(self):
        root = isoform.Model("f(x[3], a[1]) { f = sqrt(x[1]); }")
        with self.assertWarns(RuntimeWarning) as caught:
            values = root([[4.0, 0, 0], [-1.0, 0, 0]])
        self.assertEqual(values[0], 2.0)
        self.assertTrue(np.isnan(values[1]))
        self.assertIn("1 of 2 points", str(caught.warning))
        # What is infinite is no value, either: the program refuses it.
        cone = isoform.Model("f(x[3], a[1]) { array c[3]; c = [0, 0, 0]; f = hfConeX(x, c, a[1]); }")
        for reading in (cone, cone.metric):
            with self.assertWarns(RuntimeWarning):
                self.assertTrue(np.isnan(reading([[1.0, 1, 1]], [0.0])).all())


class Arrays(unittest.TestCase):
    """Whose memory is whose."""

    def test_many_points_are_as_few(self):
        ball = isoform.Model(BALL)
        points = np.random.default_rng(2).normal(size=(10_000, 3))
        whole = ball(points, VALUES)
        parts = np.concatenate([ball(points[i : i + 100], VALUES) for i in range(0, 10_000, 100)])
        self.assertTrue((whole == parts).all())
        self.assertTrue((ball(points.T.copy().T, VALUES) == whole).all())
        self.assertTrue((ball(points[::-1], VALUES) == whole[::-1]).all())

    def test_meshes_are_not_written_to(self):
        mesh = isoform.mesh(isoform.Model(BALL), size=0.8, params=VALUES)
        for array in (mesh.points, mesh.triangles, mesh.tetrahedra):
            with self.assertRaises(ValueError):
                array[0, 0] = 1

    def test_clouds_are_arrays(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.xyz"
            np.savetxt(path, on_ball(20))
            cloud = isoform.read_points(path)
        self.assertEqual(np.asarray(cloud).shape, (20, 3))
        self.assertEqual(isoform.Model(BALL)(cloud, VALUES).shape, (20,))
        self.assertEqual(len(cloud), 20)


class Work(unittest.TestCase):
    """Threads, progress, cancelling."""

    def test_threads_change_no_bit(self):
        ball, points = isoform.Model(BALL), on_ball()
        one, two = (isoform.fit(points, ball, threads=n).to_dict() for n in (1, 2))
        one.pop("seconds"), two.pop("seconds")
        self.assertEqual(one, two)

    def test_progress_can_stop(self):
        def stop(phase, done):
            return False

        started = time.monotonic()
        with self.assertRaises(IsoformError) as caught:
            isoform.mesh(isoform.Model(BALL), size=0.04, params=VALUES, progress=stop)
        self.assertEqual(caught.exception.code, "time-limit")
        self.assertLess(time.monotonic() - started, 20)

    def test_time_limit(self):
        with self.assertRaises(IsoformError) as caught:
            isoform.mesh(isoform.Model(BALL), size=0.04, params=VALUES, time_limit=0.2)
        self.assertEqual(caught.exception.code, "time-limit")

    def test_progress_in_words(self):
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            isoform.fit(on_ball(), isoform.Model(BALL), progress=True)
        self.assertTrue(said.getvalue())

    def test_calls_of_several_threads(self):
        ball, points, found = isoform.Model(BALL), on_ball(), []
        work = lambda: found.append(isoform.fit(points, ball).values["radius"])
        threads = [threading.Thread(target=work) for _ in range(4)]
        [t.start() for t in threads]
        [t.join() for t in threads]
        self.assertEqual(len(found), 4)
        self.assertEqual(len(set(found)), 1)

    @unittest.skipIf(os.name == "nt", "signals of Unix")
    def test_ctrl_c(self):
        surface = '{"F": "x^4 + y^4 + z^4 - x^2 - y^2 - z^2 + 1/3"}'
        # The last two do not look at the flag that often.
        calls = [
            f"isoform.parameterize({surface}, (3, 3), box=2, tol=1e-9, cover=True)",
            "isoform.recognize(points)",
            "isoform.compare(points, isoform.template('testpart'), samples=2_000_000)",
        ]
        for call in calls:
            with self.subTest(call):
                self.interrupt(call)

    def interrupt(self, call):
        """Ctrl-C in a call: its exception comes, and the interpreter goes on."""
        text = f"""
            import isoform, numpy as np
            points = np.random.default_rng(1).normal(size=(600_000, 3))
            print("start", flush=True)
            try: {call}
            except KeyboardInterrupt: print("stopped", flush=True)
            print(isoform.template("sphere")(points[:1], [0, 0, 0, 1]).shape)
        """
        command = [sys.executable, "-c", textwrap.dedent(text)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        process.stdout.readline()
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        self.assertEqual(process.stdout.readline().strip(), "stopped")
        # Two seconds, on a machine that does nothing else.
        self.assertLess(time.monotonic() - sent, 5)
        self.assertEqual(process.stdout.read().strip(), "(1,)")
        self.assertEqual(process.wait(timeout=30), 0)
        process.stdout.close()


class Copies(unittest.TestCase):
    """What can be copied and sent."""

    def test_models(self):
        ball, points = isoform.Model(BALL, name="ball"), on_ball(30)
        for other in (copy.deepcopy(ball), pickle.loads(pickle.dumps(ball))):
            self.assertTrue((other(points, VALUES) == ball(points, VALUES)).all())
            self.assertEqual(other.name, "ball")

    def test_fits(self):
        result = isoform.fit(on_ball(), isoform.Model(BALL))
        other = pickle.loads(pickle.dumps(result))
        self.assertEqual(other.values, result.values)
        self.assertTrue((other.deviation == result.deviation).all())
        self.assertIn("<iframe", isoform.view(other)._repr_html_())

    def test_warnings_of_programs_are_warnings(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            isoform.template("cup")


def installed(*names):
    """Whether all of these packages are there."""
    return all(importlib.util.find_spec(name) for name in names)


class Uncertified(unittest.TestCase):
    def test_a_warning_names_the_line_of_the_caller(self):
        points = np.random.default_rng(3).uniform(-1, 1, size=(300, 3))
        with self.assertWarns(isoform.UncertifiedWarning) as caught:
            found = isoform.fit(points, isoform.template("sphere"))
        self.assertEqual(caught.filename, __file__)
        self.assertIn(".reasons", str(caught.warning))
        self.assertFalse(found.acceptable)

    def test_what_is_certified_has_none(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error", isoform.UncertifiedWarning)
            isoform.mesh(isoform.Model(BALL), 0.3, params=VALUES)


class Functions(unittest.TestCase):
    """Functions of Python as models, and files as terms of programs."""

    @staticmethod
    def slab(p):
        """Half of a box's distance: positive inside, with kinks."""
        return 0.5 * (np.array([0.9, 0.6, 0.4]) - np.abs(p)).min(axis=1)

    def test_sampled_values_are_near(self):
        for box in (1.2, ((-1, -0.8, -0.7), (1.1, 0.8, 0.9))):
            made = isoform.sample(self.slab, box, accuracy=0.02)
            self.assertEqual(made.to_dict()["accuracy"], 0.02)
            lower, upper = ([-1.2] * 3, [1.2] * 3) if isinstance(box, float) else box
            p = np.random.default_rng(1).uniform(lower, upper, size=(5000, 3))
            off = np.abs(made(p) - self.slab(p)) - 0.05 * np.abs(self.slab(p))
            self.assertLess(off.max(), 0.02)
        solid = isoform.mesh(made, size=0.3)
        self.assertLess(abs(solid.volume / (8 * 0.9 * 0.6 * 0.4) - 1), 0.05)
        self.assertIn("accuracy 0.02", repr(made))

    def test_meshes_may_end_at_the_sides_of_the_box(self):
        made = isoform.sample(lambda p: 1 - np.linalg.norm(p, axis=1), 0.9, accuracy=0.01)
        solid = isoform.mesh(made, box=0.9, size=0.2)
        self.assertTrue(solid.certificate["ok"])
        self.assertEqual(sum("cap" in name for name in solid.part_names), 6)

    def test_functions_that_cannot_be_sampled(self):
        def refused(function, box=1, **given):
            with self.assertRaises(IsoformError) as caught:
                isoform.sample(function, box, **given)
            return f"{caught.exception} {caught.exception.hint}"

        self.assertIn("box", refused(self.slab, None))
        self.assertIn("positive", refused(self.slab, -1))
        self.assertIn("positive", refused(self.slab, accuracy=0))
        self.assertIn("not a number", refused(lambda p: np.full(len(p), np.nan)))
        self.assertIn("values for", refused(lambda p: np.zeros(3)))
        self.assertIn("larger", refused(lambda p: np.sign(p[:, 0]), accuracy=1e-3))
        with self.assertRaises(ZeroDivisionError):
            isoform.sample(lambda p: 1 / 0, 1)
        with self.assertRaises(IsoformError) as caught:
            isoform.mesh(self.slab)
        self.assertIn("isoform.sample", caught.exception.hint)

    def test_files_are_terms_of_programs(self):
        with tempfile.TemporaryDirectory() as folder:
            isoform.mesh(isoform.Model(BALL), 0.3, params=VALUES).save(f"{folder}/ball.stl")
            text = 'my_model(x[3], a[1]) { my_model = mesh("ball.stl", 0.1) + a[1]; }'
            path = Path(folder, "larger.hf")
            path.write_text(text)
            model = isoform.Model.load(path)
            self.assertAlmostEqual(model([[0.5, 0, 3]], [0.5])[0], -0.5, delta=0.2)
            again = pickle.loads(pickle.dumps(model))
            self.assertEqual(again([[1, 1, 1]], [0.5]), model([[1, 1, 1]], [0.5]))
            with self.assertRaises(FileNotFoundError):
                isoform.Model(text)


class Neighbours(unittest.TestCase):
    """Packages that results are handed to."""

    def setUp(self):
        self.ball = isoform.Model(BALL)
        self.mesh = isoform.mesh(self.ball, size=0.9, order=2, params=VALUES)

    @unittest.skipUnless(installed("meshio"), "meshio is not installed")
    def test_meshio_has_nodes_in_the_middles(self):
        import meshio

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "ball.msh"
            self.mesh.save(path)
            theirs = meshio.read(path)
        ours = self.mesh.to_meshio()
        for kind in ("tetra10", "triangle6"):
            a, b = theirs.get_cells_type(kind), ours.get_cells_type(kind)
            self.assertTrue((theirs.points[a] == ours.points[b]).all(), kind)

    @unittest.skipUnless(installed("pyvista"), "pyvista is not installed")
    def test_pyvista_measures_the_ball(self):
        grid = isoform.mesh(self.ball, size=0.5, params=VALUES).to_pyvista()
        self.assertAlmostEqual(grid.volume, 4 / 3 * np.pi * 8, delta=1.5)

    @unittest.skipUnless(installed("skfem"), "scikit-fem is not installed")
    def test_skfem_has_the_parts(self):
        boundaries = self.mesh.to_skfem().boundaries
        self.assertEqual(sum(map(len, boundaries.values())), len(self.mesh.triangles))

    @unittest.skipUnless(installed("pandas"), "pandas is not installed")
    def test_parameters_as_a_frame(self):
        frame = isoform.fit(on_ball(), self.ball).to_frame()
        self.assertEqual(list(frame.index), ["cx", "radius"])

    def test_what_is_missing_is_named(self):
        with self.assertRaisesRegex(ImportError, "pip install no_such_package"):
            isoform._optional.need("no_such_package.part")


class Verbs(unittest.TestCase):
    """Functions are what the program's arguments say."""

    def test_functions_are_not_stale(self):
        here = Path(__file__).parents[1]
        spec = importlib.util.spec_from_file_location("generate", here / "generate.py")
        generate = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(generate)
        text = generate.text(json.loads(isoform._isoform.schema()))
        self.assertEqual(generate.OUT.read_text(), text, "generate.py writes it anew")

    def test_paths_and_names_are_taken(self):
        with tempfile.TemporaryDirectory() as folder:
            scan, model = Path(folder) / "ball.xyz", Path(folder) / "ball.hf"
            np.savetxt(scan, on_ball())
            model.write_text(BALL)
            named = isoform.fit(scan, model)
            self.assertEqual(named.values, isoform.fit(np.loadtxt(scan), isoform.Model(BALL)).values)
            self.assertGreater(isoform.fit(str(scan), "sphere").values["radius"], 1.9)
            self.assertEqual(isoform.inspect(scan)["points"], 400)
            isoform.convert(scan, Path(folder) / "ball.ply")
            table = Path(folder) / "at.csv"
            table.write_text("0.5,0,0\n")
            told = isoform.evaluate(model, table, params=VALUES)
            self.assertEqual(told["rows"], 1)

    def test_a_scan_becomes_a_solid(self):
        box = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfBlock(x, c, 4, 3, 2); }"
        scan = isoform.mesh(isoform.Model(box), size=0.3, surface_only=True).points
        with tempfile.TemporaryDirectory() as folder:
            result = isoform.recover(scan, output=Path(folder) / "part.hf")
            result.save(Path(folder) / "part.step")
            result.save(Path(folder) / "report.html")
            solid = isoform.inspect(Path(folder) / "part.step")
            self.assertTrue((Path(folder) / "report.html").read_text().startswith("<!"))
        self.assertAlmostEqual(solid["volume"], 24, places=6)
        with self.assertRaises(IsoformError):
            result.save("part.docx")

    def test_hints_name_arguments(self):
        with self.assertRaises(IsoformError) as caught:
            isoform.parameterize(isoform.Model(BALL), cover=True)
        self.assertIn("tol", str(caught.exception))
        self.assertNotIn("--", f"{caught.exception} {caught.exception.hint}")


class Handed(unittest.TestCase):
    """Objects in the place of files, and values of all kinds."""

    BALLS = """big(x[3], a[1]) { big = 4 - x[1]^2 - x[2]^2 - x[3]^2; }
        my_model(x[3], a[1]) { my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2; }"""

    def setUp(self):
        self.ball = isoform.Model(BALL)

    def refused(self, call):
        with self.assertRaises(IsoformError) as caught:
            call()
        return f"{caught.exception} {caught.exception.hint}"

    def test_another_object_of_a_model(self):
        both = isoform.Model(self.BALLS)
        area = isoform.mesh(both, 0.4, surface_only=True, params=[0], object="big").area
        self.assertAlmostEqual(area, 16 * np.pi, delta=1.5)
        self.refused(lambda: isoform.mesh(both, 0.4, params=[0], object="small"))

    def test_samples_of_points_in_memory(self):
        self.assertEqual(isoform.inspect(on_ball(), max_points=100)["points"], 100)
        self.refused(lambda: isoform.inspect(on_ball(), format="ply"))

    def test_values_of_all_kinds(self):
        self.assertIn("null", self.refused(lambda: isoform.mesh(self.ball, params=[1, None])))
        loop = []
        loop.append(loop)
        self.assertIn("within", self.refused(lambda: isoform.mesh(self.ball, params=loop)))
        for odd in (b"12", {1, 2}, (v for v in [1.0, 2.0])):
            self.refused(lambda: isoform.mesh(self.ball, params=odd))
        sizes = [np.float64(0.7), np.float32(0.7), np.array(0.7)]
        sizes = [isoform.mesh(self.ball, size=s, params=VALUES).to_dict()["size"] for s in sizes]
        self.assertEqual(sizes, [0.7, float(np.float32(0.7)), 0.7])
        mesh = isoform.mesh(self.ball, 0.7, surface_only=np.bool_(True), params=VALUES)
        self.assertEqual(len(mesh.tetrahedra), 0)
        result = isoform.fit(on_ball(), self.ball, bounds={"radius": (0, np.inf)})
        self.assertAlmostEqual(result.values["radius"], 2, places=2)

    def test_results_are_inputs(self):
        result, points = isoform.fit(on_ball(), self.ball), on_ball(1500)
        function = isoform.implicitize(points)
        mesh = isoform.mesh(function, size=0.6)
        for other in (result, function, isoform.mesh(result, 0.4), points):
            self.assertLess(isoform.compare(mesh, other).second_to_first["max"], 0.3)
        self.assertTrue(isoform.fit(mesh, "sphere").values["radius"] > 1.9)
        for wrong in (function, isoform.recognize(points)):
            with self.assertRaises((IsoformError, TypeError)):
                isoform.fit(wrong, self.ball)
        self.assertIn("not points", self.refused(lambda: isoform.fit(function, self.ball)))
        self.assertIn("not a model", self.refused(lambda: isoform.brep(mesh)))
        triangle = isoform.triangulate(
            {"X": "s", "Y": "t", "Z": "0", "W": "1"}, box=2, polygon=[(0, 0), (1, 0), (0, 1)]
        )
        self.assertEqual(isoform.compare(triangle, triangle).first_to_second["max"], 0)

    def test_names_with_dashes_stay(self):
        self.assertIn("my--file", self.refused(lambda: isoform.mesh("my--file.hf")))

    def test_what_failed_in_part_is_told(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "ball.msh"
            result = isoform.recover(on_ball(), self.ball, output=path, memory=1e-6)
        self.assertFalse(result.to_dict()["ok"])
        self.assertTrue(any("memory" in w or "meshed" in w for w in result.warnings), result.warnings)

    def test_names_on_disk_are_plain(self):
        with tempfile.TemporaryDirectory() as folder:
            isoform.recover(on_ball(), self.ball, output=folder + "/out/")
            text = (Path(folder) / "out" / "scan.txt").read_text()
        self.assertIn("array", text)
        self.assertTrue(text.isascii(), text)


class Shapes(unittest.TestCase):
    """One way through all verbs."""

    def test_from_points_to_a_solid(self):
        with tempfile.TemporaryDirectory() as folder:
            result = isoform.fit(on_ball(), isoform.Model(BALL))
            self.assertAlmostEqual(result.values["radius"], 2.0, places=3)
            solid = isoform.brep(result.model)
            self.assertAlmostEqual(solid.volume, 4 / 3 * np.pi * result.values["radius"] ** 3)
            solid.save(Path(folder) / "ball.step")
            mesh = isoform.mesh(result.model, size=0.5)
            self.assertTrue(mesh.certificate["ok"])
            self.assertEqual(len(mesh.triangles), len(mesh.triangle_parts))
            far = isoform.compare(mesh, result.model).first_to_second["max"]
            self.assertLess(far, 0.05)

    def test_patches_and_maps(self):
        patches = isoform.parameterize({"F": "x^2 + y^2 + z^2 - 1/4"}, (2, 2), tol=1e-3)
        point = patches[0].evaluate(0.5, 0.5)
        self.assertAlmostEqual(float(np.linalg.norm(point)), 0.5, places=3)
        self.assertEqual(patches[0].evaluate([0, 1], [[0], [1], [1]]).shape, (3, 2, 3))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "patches.json"
            patches.save(path)
            drawn = isoform.triangulate(path)
        self.assertEqual(drawn.points.shape[1], 3)

    def test_arrays_and_expressions_in_documents(self):
        class Expression:  # as sympy writes one
            def __str__(self):
                return "s**2"

        bowl = {"X": "s", "Y": "t", "Z": Expression(), "W": 1}
        texts = {"X": "s", "Y": "t", "Z": "s^2", "W": "1"}
        drawn = [isoform.triangulate(shape, box=1, tol=0.1) for shape in (bowl, texts)]
        np.testing.assert_array_equal(drawn[0].points, drawn[1].points)
        ends, grid = np.array([0, 0, 1, 1]), np.zeros((2, 2, 3))
        grid[1, :, 0] = grid[:, 1, 1] = 1
        net = {"degree": (1, 1), "knots_u": ends, "knots_v": ends, "points": grid}
        self.assertAlmostEqual(isoform.triangulate(net).points[:, :2].max(), 1)
        grid[0, 0, 0] = np.nan
        with self.assertRaisesRegex(IsoformError, "not finite"):
            isoform.triangulate(net)
        with self.assertRaisesRegex(IsoformError, "functions of Python"):
            isoform.mesh(lambda p: 1 - (p**2).sum(axis=1))

    def test_boxes_are_exact(self):
        plane = {"X": "s", "Y": "t", "Z": "0", "W": "1"}
        boxes = [isoform.triangulate(plane, box=b).to_dict()["box"] for b in (0.1, "1/10")]
        self.assertEqual(boxes, ["1/10", "1/10"])

    def test_functions_through_points(self):
        function = isoform.implicitize(on_ball(1500))
        with tempfile.TemporaryDirectory() as folder:
            function.save(Path(folder) / "surface.json")
        self.assertGreater(function([[0.5, 0, 1.8]])[0], 0)
        self.assertLess(function([[0.5, 0, 2.2]])[0], 0)
        self.assertLess(np.abs(function.metric(on_ball(50))).max(), 0.02)

    def test_entities(self):
        found = isoform.recognize(on_ball(1500))
        self.assertEqual([e["type"] for e in found.entities], ["sphere"])
        self.assertEqual(found.labels.shape, (1500,))
        again = isoform.fit(on_ball(1500), found.template())
        self.assertTrue(again.acceptable)


if __name__ == "__main__":
    unittest.main()
