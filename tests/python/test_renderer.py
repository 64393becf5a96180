# SPDX-License-Identifier: Apache-2.0
"""Frames and HIPs from numpy arrays, one at a time and in batches."""

import gc
import unittest
import weakref

import numpy
import palpate

CAMERA = palpate.Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def wall(millimetres=1000):
    return numpy.full((48, 64), millimetres, numpy.uint16)


class Renderer(unittest.TestCase):
    def touch(self, **parameters):
        touch = palpate.Renderer("sight", **parameters)
        touch.frame(wall(), camera=CAMERA, stamp=0.0)
        touch.seat((0, 0, 0.9))
        return touch

    def test_pushes_back_by_hookes_law(self):
        touch = self.touch(stiffness=500)
        self.assertEqual(touch.tick((0, 0, 0.9), 0.0).state, palpate.State.FREE)
        tick = touch.tick(numpy.array([0, 0, 1.01]), 0.001)
        # The proxy's centre rests r_c = 5 mm in front of the wall.
        numpy.testing.assert_allclose(tick.proxy, (0, 0, 0.995), atol=2e-4)
        # (15): how far the HIP is behind what the sphere touches, 10 mm.
        numpy.testing.assert_allclose(tick.force, (0, 0, -500 * 0.010), atol=1e-2)
        numpy.testing.assert_allclose(tick.normal, (0, 0, -1), atol=1e-3)
        self.assertEqual(palpate.flags(tick.flags), {})

    def test_touches_with_a_tool_that_is_turned(self):
        touch = palpate.Renderer("sight", tool="box:40x20x5mm")
        touch.frame(wall(), camera=CAMERA, stamp=0.0)
        flat, tilted = (0, 0, 0, 1), (numpy.sin(0.1), 0, 0, numpy.cos(0.1))
        for i in range(200):
            tick = touch.tick((0, 0, 0.95), 1e-3 * i, tilted)
        numpy.testing.assert_allclose(tick.orientation, tilted)
        numpy.testing.assert_array_equal(tick.torque, 0)
        self.assertEqual(tick.contacts.shape, (0, 6))
        for i in range(400):
            tick = touch.tick((0, 0, 0.9951), 0.2 + 1e-3 * i, tilted)
        # The edge at +y is 10 mm sin 0.2 + 2.5 mm cos 0.2 = 4.4 mm ahead of the hand.
        self.assertEqual(tick.force[2], 0)
        for i in range(400):
            tick = touch.tick((0, 0, 0.999), 0.7 + 1e-3 * i, tilted)
        self.assertLess(tick.force[2], -1)
        self.assertLess(tick.torque[0], -5e-3)
        self.assertLess(tick.proxy_orientation[0], tick.orientation[0])
        place, push = tick.contacts[:, :3], tick.contacts[:, 3:]
        numpy.testing.assert_allclose(push.sum(axis=0), tick.force, atol=0.01)
        numpy.testing.assert_allclose(place[:, 2], 1.0, atol=2e-4)
        self.assertTrue((place[:, 1] > 8e-3).all())
        for wrong, message in (((0, 0, 0, 2), "length"), ((0, 0, 1), "shape")):
            with self.assertRaisesRegex(palpate.Error, message):
                touch.tick((0, 0, 0.9), 2.0, wrong)
        with self.assertRaisesRegex(palpate.Error, "ball"):
            palpate.Renderer("paper", tool="box:40x20x5mm")
        ticks = palpate.Renderer().ticks([(0, 0, 0)], [0.0])
        numpy.testing.assert_array_equal(ticks["proxy_orientation"], [flat])

    def test_feels_what_a_pixel_is_made_of(self):
        materials = palpate.Materials([{"name": "cushion", "like": "foam", "stiffness": 150},
                                       {"name": "board", "friction": 0.5}])
        self.assertEqual(materials.names, ["cushion", "board"])
        labels = numpy.ones(wall().shape, numpy.uint8)
        labels[:, labels.shape[1] // 2:] = 2
        for x, stiffness, friction in ((-0.05, 150, 0.6), (0.05, 600, 0.5)):
            touch = palpate.Renderer()
            touch.frame(wall(), camera=CAMERA, stamp=0.0, materials=materials, labels=labels)
            touch.seat((x, 0, 0.9))
            way = ([(x, 0, 0.99 + 1e-4 * i) for i in range(100)] +
                   [(x + 1e-4 * i, 0, 1.0) for i in range(100)])
            ticks = touch.ticks(way, numpy.arange(200) * 1e-3)
            force = -ticks["force"][:, 2]
            depth = ticks["hip"][-1, 2] - 1.0
            last = touch.tick((x + 0.01, 0, 1.006), 0.3)
            self.assertAlmostEqual(-last.force[2], stiffness * 0.006, delta=0.1 * stiffness * 0.006)
            self.assertAlmostEqual(last.hardness, stiffness / 600, places=2)
            self.assertTrue((force >= 0).all() and depth >= 0)
            slide = touch.ticks([(x + 0.01 + 1e-4 * i, 0, 1.006) for i in range(100)],
                                0.301 + numpy.arange(100) * 1e-3)["force"][-1]
            self.assertGreater(-slide[0] / -slide[2], 0.75 * friction)
        self.assertIn("wood", palpate.materials())
        for wrong, message in (({"labels": labels}, "materials"),
                               ({"materials": materials}, "labels"),
                               ({"materials": materials, "labels": labels[1:]}, "shape")):
            with self.assertRaisesRegex(palpate.Error, message):
                palpate.DepthImage(wall(), CAMERA, **wrong)
        with self.assertRaisesRegex(palpate.Error, "'wood'"):
            palpate.Materials("wod")
        with self.assertRaisesRegex(palpate.Error, "friction"):
            palpate.Materials([{"name": "a", "frction": 0.5}])

    def test_a_batch_is_its_single_ticks(self):
        hips = numpy.linspace((0, 0, 0.98), (0.005, 0, 1.005), 200)
        times = numpy.arange(200) * 1e-3
        batch = self.touch().ticks(hips, times)
        single = self.touch()
        for i, (hip, t) in enumerate(zip(hips, times)):
            tick = single.tick(hip, t)
            for name in ("t", "hip", "proxy", "normal", "force", "frame", "flags", "steps"):
                self.assertTrue(numpy.array_equal(batch[name][i], getattr(tick, name)), name)
            self.assertEqual(palpate.State(batch["state"][i]), tick.state)
        self.assertGreater(numpy.abs(batch["force"]).max(), 1.0)

    def test_keeps_the_depth_it_was_given_and_copies_nothing(self):
        class Array(numpy.ndarray):
            pass

        depth = wall().view(Array)
        alive = weakref.ref(depth)
        image = palpate.DepthImage(depth, CAMERA)
        self.assertEqual(image.depth.ctypes.data, depth.ctypes.data)
        touch = palpate.Renderer()
        touch.frame(image, 0.0)
        touch.tick((0, 0, 0.9), 0.0)
        del depth, image
        gc.collect()
        self.assertIsNotNone(alive(), "the renderer needs it")
        self.assertGreater(-touch.tick((0, 0, 1.01), 0.001).force[2], 1.0)
        touch.frame(wall(), camera=CAMERA, stamp=0.03)
        gc.collect()
        self.assertIsNone(alive(), "nothing needs it any more")

    def test_what_it_shows_of_an_image_cannot_be_written_to(self):
        image = palpate.DepthImage(wall(), CAMERA)
        view = image.depth
        del image
        gc.collect()
        self.assertEqual(view[3, 4], 1000)
        with self.assertRaises(ValueError):
            view[0, 0] = 1

    def test_touches_points_and_poses(self):
        fine = palpate.Camera(64, 48, 300.0, 300.0, 31.5, 23.5)  # 3.3 mm a pixel
        points = palpate.DepthImage(wall(), fine).points()
        touch = palpate.Renderer("paper")
        touch.frame(points, stamp=0.0, viewpoint=(0, 0, 0))
        touch.seat((0, 0, 0.9))
        self.assertGreater(-touch.ticks([(0, 0, 1.01)] * 60, [0.0] * 60)["force"][-1, 2], 1.0)
        pose = numpy.eye(4)
        pose[:3, 3] = (1, 2, 3)
        moved = palpate.DepthImage(wall(), fine, world_from_camera=pose)
        numpy.testing.assert_allclose(moved.points(), points + (1, 2, 3), atol=1e-9)

    def test_parameters_are_those_of_the_table(self):
        touch = palpate.Renderer(damping=1.5)
        self.assertEqual(touch.parameters["damping"], 1.5)
        touch.set(stiffness=300)
        self.assertEqual(touch.parameters["stiffness"], 300)
        table = palpate.parameters()
        self.assertEqual(table["stiffness"]["unit"], "N/m")
        self.assertEqual(set(table), set(touch.parameters))
        self.assertIn("max_device_force", palpate.limits())
        self.assertIn("sight", palpate.methods())
        with self.assertRaisesRegex(palpate.Error, "did you mean 'stiffness'"):
            touch.set(stifness=1)
        self.assertEqual(touch.parameters["stiffness"], 300)

    def test_refuses_what_is_no_frame(self):
        touch = palpate.Renderer()
        for depth, says in ((wall().astype(float), "uint16"), (wall()[::2], r"\(48, 64\)"),
                            (wall().T.copy().T, "ascontiguousarray"), (wall().ravel(), "shape")):
            with self.assertRaisesRegex((palpate.Error, TypeError), says):
                touch.frame(depth, camera=CAMERA, stamp=0.0)
        with self.assertRaisesRegex(palpate.Error, "world_from_camera"):
            touch.frame(wall(), camera=CAMERA, stamp=0.0, world_from_camera=2 * numpy.eye(4))
        with self.assertRaisesRegex(palpate.Error, "one time"):
            touch.ticks([(0, 0, 0)] * 3, [0.0])
        with self.assertRaisesRegex(palpate.Error, "no such method"):
            palpate.Renderer("sihgt")
        self.assertTrue(issubclass(palpate.Error, ValueError))
        # Nothing was touched, so nothing is felt, whatever comes.
        tick = touch.tick((numpy.nan, 0, 0), 0.0)
        self.assertEqual(tuple(tick.force), (0, 0, 0))

    def test_leans_on_the_pixels_that_are_said_to_be_quiet(self):
        near = palpate.Camera(64, 48, 300.0, 300.0, 31.5, 23.5)
        half = numpy.tile(numpy.where(numpy.arange(64) < 32, 0.5, 5.0), (48, 1))  # [mm]

        def error(**noise):
            random, touch, off = numpy.random.default_rng(1), palpate.Renderer(), []
            for i in range(150):
                depth = (wall(500) + random.normal(0, half)).round().astype(numpy.uint16)
                touch.frame(depth, camera=near, stamp=i / 30, **noise)
                hips = numpy.tile((0, 0, min(0.45 + 0.005 * i, 0.501)), (33, 1))
                proxy = touch.ticks(hips, i / 30 + 1e-3 * numpy.arange(33))["proxy"]
                off.append(proxy[-1, 2] - 0.495)  # r_c in front of it
            return numpy.sqrt(numpy.mean(numpy.square(off[30:])))

        untold, told = error(), error(noise=half)
        self.assertLess(told, 0.5 * untold)

    def test_keeps_the_noise_of_an_image_and_refuses_what_is_none(self):
        noise = numpy.arange(48 * 64).reshape(48, 64) / 16
        for kind in (numpy.float64, numpy.float32):
            image = palpate.DepthImage(wall(), CAMERA, noise=noise.astype(kind))
            numpy.testing.assert_array_equal(image.noise, noise)
        self.assertIsNone(palpate.DepthImage(wall(), CAMERA).noise)
        for value, says in ((numpy.nan, "it is nan"), (numpy.inf, "it is inf"), (-1, "it is -1")):
            wrong = noise.copy()
            wrong[3, 7] = value
            with self.assertRaisesRegex(palpate.Error,
                                        f"noise: {says}.* at row 3, column 7; give a standard"):
                palpate.DepthImage(wall(), CAMERA, noise=wrong)

    def test_names_the_shape_that_is_needed_and_the_one_that_was_given(self):
        zeros = numpy.zeros
        touch, ones = self.touch(), numpy.ones((48, 64), numpy.uint8)
        wood = palpate.Materials("wood")
        image = palpate.DepthImage(wall(), CAMERA)

        def session(**keywords):
            return palpate.Session("synthetic:plane?size=64x48", free_running=True, **keywords)

        class Answers(palpate.Method):
            def __init__(self, *answer):
                self.answer = answer

            def frame(self, cloud, stamp):
                pass

            def tick(self, hip, t):
                return self.answer

        def answered(*answer):
            mine = palpate.Renderer(Answers(*answer))
            mine.frame(wall(), camera=CAMERA, stamp=0.0)
            mine.tick((0, 0, 0), 0.0)

        for call, name, given, needed in (
                (lambda: touch.tick(zeros(4), 0.0), "hip", "(4,)", "(3,)"),
                (lambda: touch.tick(0.5, 0.0), "hip", "()", "(3,)"),
                (lambda: touch.seat([0, 0]), "proxy", "(2,)", "(3,)"),
                (lambda: touch.ticks(zeros(3), [0.0]), "hips", "(3,)", "(n, 3)"),
                (lambda: touch.ticks(zeros((5, 2)), zeros(5)), "hips", "(5, 2)", "(n, 3)"),
                (lambda: touch.ticks(zeros((5, 3)), zeros((5, 2))), "times", "(5, 2)", "(5,)"),
                (lambda: touch.ticks(zeros((5, 3)), zeros(4)), "times", "(4,)", "(5,)"),
                (lambda: touch.frame(zeros((3, 9)), stamp=0.0), "points", "(3, 9)", "points.T"),
                (lambda: touch.frame(zeros((9, 4)), stamp=0.0), "points", "(9, 4)", "(n, 3)"),
                (lambda: touch.frame(wall(), stamp=0.0), "points", "(48, 64)", "camera="),
                (lambda: touch.frame(wall().T, camera=CAMERA, stamp=0.0), "depth", "(64, 48)",
                 "depth.T"),
                (lambda: touch.frame(wall()[None], camera=CAMERA, stamp=0.0), "depth",
                 "(1, 48, 64)", "(48, 64)"),
                (lambda: palpate.PointCloud(zeros((9, 3)), viewpoint=zeros(2)), "viewpoint",
                 "(2,)", "(3,)"),
                (lambda: palpate.PointCloud(zeros(9)), "points", "(9,)", "(n, 3)"),
                (lambda: image.near(zeros(2), 0.01), "centre", "(2,)", "(3,)"),
                (lambda: palpate.DepthImage(wall(), CAMERA, world_from_camera=numpy.eye(3)),
                 "world_from_camera", "(3, 3)", "(4, 4)"),
                (lambda: palpate.DepthImage(wall(), CAMERA, materials=wood, labels=ones.T),
                 "labels", "(64, 48)", "labels.T"),
                (lambda: palpate.DepthImage(wall(), CAMERA, brightness=ones[1:]),
                 "brightness", "(47, 64)", "(48, 64)"),
                (lambda: palpate.DepthImage(wall(), CAMERA, noise=ones.T), "noise", "(64, 48)",
                 "noise.T"),
                (lambda: touch.frame(wall(), camera=CAMERA, stamp=0.0, noise=2.0), "noise", "()",
                 "(48, 64)"),
                (lambda: palpate.trace("synthetic:plane", zeros((9, 3))), "path", "(9, 3)",
                 "(n, 4)"),
                (lambda: session(world_from_device=zeros(16)), "world_from_device", "(16,)",
                 "(4, 4)"),
                (lambda: session(hands=[{"device": "hand:", "world_from_device": numpy.eye(3)}]),
                 "world_from_device", "(3, 3)", "(4, 4)"),
                (lambda: answered(zeros(2), zeros(3)), "proxy", "(2,)", "(3,)"),
                (lambda: answered(zeros(3), zeros((3, 3))), "force", "(3, 3)", "(3,)"),
                (lambda: answered(zeros(3), zeros(3), 1.0), "normal", "()", "(3,)")):
            with self.subTest(name=name, given=given):
                with self.assertRaises(palpate.Error) as caught:
                    call()
                text = str(caught.exception)
                self.assertTrue(text.startswith(f"{name}: its shape is {given}, not "), text)
                self.assertIn(needed, text)
                self.assertRegex(text, "; give ")
        self.assertEqual(touch.tick(zeros((3, 1)), 0.0).hip.shape, (3,))  # a column will do


if __name__ == "__main__":
    unittest.main()
