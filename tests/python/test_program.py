# SPDX-License-Identifier: Apache-2.0
"""Traces, sources and sessions: what Python gets is what the program gets."""

import csv
import io
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy
import palpate

CAMERA = "synthetic:desk?noise=1mm&size=160x120"


def traced_by_the_program(*arguments):
    text = subprocess.run([os.environ["PALPATE_PROGRAM"], "trace", "--camera", CAMERA, *arguments],
                          check=True, capture_output=True, text=True).stdout
    return list(csv.DictReader(io.StringIO(text)))


class Trace(unittest.TestCase):
    def expect_the_same(self, ticks, rows):
        self.assertEqual(len(ticks), len(rows))
        for name in ("hip", "proxy", "normal", "force"):
            for axis, letter in enumerate("xyz"):
                theirs = numpy.array([float(row[f"{name}_{letter}"]) for row in rows])
                self.assertTrue(numpy.array_equal(ticks[name][:, axis], theirs), name)
        for name in ("t", "surface_velocity", "frame", "flags", "steps"):
            self.assertTrue(
                numpy.array_equal(ticks[name], [float(row[name]) for row in rows]), name)
        self.assertGreater(numpy.linalg.norm(ticks["force"], axis=1).max(), 1.0)

    def test_a_press_is_the_programs_to_the_bit(self):
        ticks = palpate.trace(CAMERA, press=(80, 60), slide_to=(90, 62), stiffness=450)
        self.expect_the_same(ticks, traced_by_the_program(
            "--press", "80,60", "--slide-to", "90,62", "--set", "stiffness=450"))

    def test_a_path_is_the_programs_to_the_bit(self):
        first = palpate.trace(CAMERA, press=(80, 60))
        samples = numpy.column_stack((first["t"], first["hip"]))[::50]
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "path.csv"
            numpy.savetxt(file, samples, fmt="%.17g", delimiter=",", header="t,x,y,z", comments="")
            rows = traced_by_the_program("--path", str(file), "--method", "paper")
            self.expect_the_same(palpate.trace(CAMERA, file, method="paper"), rows)
            self.expect_the_same(palpate.trace([CAMERA], samples, method="paper"), rows)

    def test_refuses_what_is_no_path(self):
        for arguments, says in (({}, "one of path and press"),
                                ({"path": "nowhere.csv"}, "nowhere.csv"),
                                ({"path": [[1, 2, 3]]}, r"its shape is \(1, 3\), not \(n, 4\)"),
                                ({"press": (900, 0)}, "900"),
                                ({"press": (80, 60), "rate": 0.0}, "rate")):
            with self.assertRaisesRegex(palpate.Error, says):
                palpate.trace(CAMERA, **arguments)


class Source(unittest.TestCase):
    def test_gives_frames_in_order(self):
        source = palpate.Source(CAMERA)
        self.assertFalse(source.info["live"])
        frames = [source.next() for _ in range(3)]
        numpy.testing.assert_allclose([frame.stamp for frame in frames], [0, 1 / 30, 2 / 30])
        self.assertEqual(frames[0].depth.shape, (120, 160))
        self.assertEqual(frames[0].camera.width, 160)
        metres = frames[0].metres()
        numpy.testing.assert_allclose(metres * frames[0].units_per_metre, frames[0].depth,
                                      rtol=1e-6)
        self.assertEqual(frames[0].points().shape, (numpy.isfinite(metres).sum(), 3))

    def test_a_recording_ends(self):
        points = "\n".join(f"{x} 0 1" for x in (0, 0.01, 0.02))
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "line.pcd"
            file.write_text("VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
                            "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n"
                            "DATA ascii\n" + points)
            frames = list(palpate.Source(f"pcd:{file}"))
        self.assertEqual(len(frames), 1)
        self.assertEqual(len(frames[0].cloud), 3)
        with self.assertRaisesRegex(palpate.Error, "no such file"):
            palpate.Source("pcd:/nowhere.pcd")


class Session(unittest.TestCase):
    def test_free_running_is_the_same_each_time(self):
        def run():
            with palpate.Session(CAMERA, free_running=True, stroke_time=2.0) as session:
                session.run(2.0)
                return session.ticks(), session.state()

        ticks, state = run()
        self.assertEqual(len(ticks), 2000)
        self.assertEqual(ticks.tobytes(), run()[0].tobytes())
        forces = numpy.linalg.norm(ticks["force"], axis=1)
        self.assertGreater(forces.max(), 0.2)
        self.assertLessEqual(forces.max(), palpate.limits()["max_device_force"]["default"] + 1e-9)
        self.assertEqual(state["ticks"], 2000)
        self.assertTrue(palpate.safety_flags(int(ticks["safety"][0])))

    def test_touches_what_an_object_gives_as_it_touches_its_source(self):
        def ticks(camera, duration=2.0):
            with palpate.Session(camera, free_running=True, stroke_time=2.0) as session:
                session.run(duration)
                return session.ticks(), session.state()["cameras"][0]

        source = palpate.Source(CAMERA)
        frames = [source.next() for _ in range(90)]
        of_source, _ = ticks(CAMERA)
        of_object, camera = ticks((frame.cloud, frame.stamp) for frame in frames)
        self.assertEqual(of_object.tobytes(), of_source.tobytes())
        self.assertEqual(camera["uri"], "python:generator")
        self.assertGreater(numpy.linalg.norm(of_object["force"], axis=1).max(), 0.2)

        class Halved:
            scale_reference = "plane:0,0,1,1"

            def __iter__(self):
                image = palpate.DepthImage(numpy.full((120, 160), 480, numpy.uint16),
                                           palpate.Camera(160, 120, 150, 150, 79.5, 59.5))
                return iter([(image, i / 30) for i in range(90)])

        class Farther(Halved):
            scale_reference = "plane:0,0,1,0.5"

        for camera, is_unsure in ((Halved(), True), (Farther(), False)):
            safety = ticks(camera, 2.5)[0]["safety"]
            self.assertEqual("scale_unsure" in palpate.safety_flags(int(safety[-1])), is_unsure)

        soft = palpate.Materials([{"name": "foam", "stiffness": 50}])
        ones = numpy.ones((120, 160), numpy.uint8)
        of_foam = [(palpate.DepthImage(frame.depth, frame.camera, frame.units_per_metre,
                                       frame.world_from_camera, materials=soft, labels=ones),
                    frame.stamp) for frame in frames]
        largest = [numpy.linalg.norm(made["force"], axis=1).max()
                   for made in (ticks(of for of in of_foam)[0], of_source)]
        self.assertLess(largest[0], 0.5 * largest[1])

        def breaks():
            yield frames[0].cloud, 0.0
            raise RuntimeError("out of memory")

        for wrong, says in ((7, "iterate"), ([[1, 2, 3]], "its time"), ([iter([])], "frame")):
            with self.assertRaisesRegex(palpate.Error, says):
                palpate.Session(wrong, free_running=True)
        with self.assertRaisesRegex(palpate.Error, "out of memory"):
            ticks(breaks())

    def test_changes_its_tool(self):
        session = palpate.Session("synthetic:plane?size=160x120", free_running=True, stroke_time=2)
        session.set(tool="box:40x20x5mm?points=200")
        for wrong in ({"tool": "spoon:4mm"}, {"method": "paper"}):
            with self.assertRaises(palpate.Error):
                session.set(**wrong)
        session.run(1.5)
        ticks = session.ticks()
        self.assertGreater(numpy.abs(ticks["force"]).max(), 0.5)
        numpy.testing.assert_array_equal(ticks["orientation"][-1], (0, 0, 0, 1))
        # A ball would be r_c = 5 mm above the plane, the box is 2.5 mm.
        pressed = ticks[numpy.abs(ticks["force"][:, 2]) > 0.5]
        self.assertLess(pressed["proxy"][:, 2].max(), 4e-3)

    def test_records_what_it_can_read(self):
        with tempfile.TemporaryDirectory() as folder:
            bag = os.path.join(folder, "session")
            with palpate.Session(CAMERA, free_running=True, stroke_time=1.0, record=bag) as session:
                session.run(1.0)
                ticks = session.ticks()
            self.assertEqual(palpate.read_session(bag).tobytes(), ticks.tobytes())
            self.assertEqual(len(list(palpate.Source(f"recording:{bag}"))), 30)

    def test_records_the_noise_that_an_object_knows(self):
        class Knows:
            def __iter__(self):
                for i, frame in enumerate(palpate.Source(CAMERA)):
                    noise = numpy.where(frame.depth % 3 == 0, 30.0, 3.0) + i // 10
                    yield palpate.DepthImage(frame.depth, frame.camera, frame.units_per_metre,
                                             frame.world_from_camera, noise=noise), frame.stamp

        with tempfile.TemporaryDirectory() as folder:
            bag = os.path.join(folder, "session")
            with palpate.Session(Knows(), free_running=True, stroke_time=2.0,
                                 record=bag) as session:
                session.run(2.0)
                self.assertGreater(numpy.abs(session.ticks()["force"]).max(), 0.1)
            program = [os.environ["PALPATE_PROGRAM"], "replay", bag]
            self.assertIn("asked: identical", subprocess.run(program, check=True, text=True,
                                                             stdout=subprocess.PIPE).stdout)
            read = [frame.cloud.noise for frame in palpate.Source(f"recording:{bag}")]
            self.assertGreater(len(read), 50)
            wrote = [image.noise for (image, _), _ in zip(Knows(), read)]
            numpy.testing.assert_array_equal(read, wrote)

    def test_feels_fixtures_in_free_air(self):
        wall = ("[[fixture]]\nname = \"all\"\nshape = \"sphere\"\n"
                "pose = [0, 0, 0.4, 0, 0, 0, 1]\nradius = 0.05")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "path.csv"
            path.write_text("t,x,y,z\n0,0,0,0.3\n2,0,0,0.3\n2.5,0,0,0.353\n3,0,0,0.353\n")

            def force(fixtures):
                with palpate.Session(CAMERA, device=f"script:{path}", free_running=True,
                                     fixtures=fixtures) as session:
                    session.run(3.0)
                    return session.ticks()["force"][-1]

            self.assertEqual(numpy.linalg.norm(force(None)), 0.0)
            self.assertLess(force(wall)[2], -0.5)
        with palpate.Session(CAMERA) as session:
            session.fixtures(wall)
            session.fixtures(None)
            with self.assertRaisesRegex(palpate.Error, "did you mean 'radius'"):
                session.fixtures(wall.replace("radius", "radus"))

    def test_asks_what_frames_are_made_of(self):
        asked = []

        def labels(camera, depth):
            asked.append((camera, depth.shape))
            found = numpy.zeros(depth.shape, numpy.uint8)
            found[:, depth.shape[1] // 2:] = 1
            return found

        keep_off = ("[[fixture]]\nname = \"off\"\nshape = \"seen\"\nmaterial = \"tissue\"\n"
                    "pose = [0, 0, 0, 0, 0, 0, 1]\nsize = [1, 1, 1]\nmargin = 0.02")
        materials = palpate.Materials([{"name": "tissue", "like": "rubber"}])
        with tempfile.TemporaryDirectory() as folder:
            forces = []
            for x in (-0.05, 0.05):  # 10 mm above the plane, on either side
                path = pathlib.Path(folder) / "path.csv"
                path.write_text(f"t,x,y,z\n0,{x},0,0.1\n1,{x},0,0.1\n2,{x},0,0.01\n3,{x},0,0.01\n")
                with palpate.Session("synthetic:plane?size=160x120&distance=0.5",
                                     device=f"script:{path}", free_running=True, fixtures=keep_off,
                                     materials=materials, labels=labels) as session:
                    session.run(4.0)
                    forces.append(session.ticks()["force"][-1])
                    self.assertEqual(session.state()["cameras"][0]["doubt"], "")
        self.assertEqual(numpy.linalg.norm(forces[0]), 0.0)
        self.assertGreater(forces[1][2], 1.0)
        self.assertEqual(asked[0], (0, (120, 160)))

        def wrong(camera, depth):
            raise ValueError("no idea")

        with palpate.Session(CAMERA, free_running=True, materials=materials,
                             labels=wrong) as session:
            session.run(0.1)
            self.assertIn("no idea", session.state()["cameras"][0]["doubt"])
        with self.assertRaisesRegex(palpate.Error, "no camera knows a material 'tissue'"):
            palpate.Session(CAMERA, fixtures=keep_off)
        with self.assertRaisesRegex(palpate.Error, "of no use without the other"):
            palpate.Session(CAMERA, labels=labels)

    def test_has_several_hands(self):
        with tempfile.TemporaryDirectory() as folder:
            bag = os.path.join(folder, "session")
            hands = ["hand:", {"device": "hand:", "name": "left", "scale": 0.5,
                               "bubble_radius": 0.05}]
            with palpate.Session(CAMERA, free_running=True, stroke_time=1.0, hands=hands,
                                 record=bag) as session:
                session.run(1.0)
                ticks = [session.ticks(hand) for hand in range(3)]
                state = session.state()
            self.assertEqual([len(each) for each in ticks], [1000] * 3)
            self.assertEqual(ticks[0].tobytes(), ticks[1].tobytes())
            self.assertNotEqual(ticks[0].tobytes(), ticks[2].tobytes())
            self.assertEqual([each["name"] for each in state["more_hands"]], ["hand_2", "left"])
            self.assertEqual(palpate.read_session(f"{bag}/left").tobytes(), ticks[2].tobytes())
            with self.assertRaisesRegex(palpate.Error, "none of this number"):
                session.ticks(3)
        with self.assertRaisesRegex(palpate.Error, "a hand has no 'divice'"):
            palpate.Session(CAMERA, hands=[{"divice": "hand:"}])

    def test_runs_in_real_time_and_can_be_changed(self):
        with palpate.Session(CAMERA) as session:
            session.set(stiffness=200, method="paper")
            session.limit(max_device_force=1.0)
            session.run(0.3)
            self.assertGreater(len(session.ticks()), 0)
            self.assertEqual(session.state()["method"], "paper")
        with self.assertRaisesRegex(palpate.Error, "max_device_force"):
            palpate.Session(CAMERA, limits={"max_device_force": -1})


if __name__ == "__main__":
    unittest.main()
