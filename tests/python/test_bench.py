# SPDX-License-Identifier: Apache-2.0
"""A method written in Python scores as its twin in C++; its faults are not swallowed."""

import tempfile
import unittest

import numpy
import palpate


class Direct(palpate.Method):  # lab/methods/direct.cpp in Python
    def frame(self, cloud, stamp):
        self.cloud = cloud

    def tick(self, hip, t):
        near = self.cloud.near(hip, 0.035) - hip
        q = numpy.maximum(1 - numpy.linalg.norm(near, axis=1) / 0.035, 0)
        w = q**4 * (4 * (1 - q) + 1)
        if len(near) < 6 or w.sum() <= 1e-12:
            return hip, numpy.zeros(3)
        mean = w @ near / w.sum()
        off = near - mean
        normal = numpy.linalg.eigh((off.T * w) @ off)[1][:, 0]
        if normal @ (self.cloud.viewpoint - hip - mean) < 0:
            normal = -normal
        depth = normal @ mean
        if depth <= 0:
            return hip, numpy.zeros(3)
        return hip + (0.005 + depth) * normal, min(600 * depth, 20) * normal, normal


class Bench(unittest.TestCase):
    def test_a_method_in_python_scores_as_its_twin(self):
        scores = palpate.bench.pop([Direct(), "direct"], cases=1, seed=5,
                                   families=["first-contact", "hold", "layers"])
        self.assertEqual(len(scores.rows), 4)
        for row in scores.rows:
            cells = dict(zip(scores.columns, row))
            for column in ("held [%]", "right [%]"):
                if f"Direct {column}" in cells:
                    self.assertEqual(cells[f"Direct {column}"], cells[f"direct {column}"], row)
        self.assertIn("direct held [%]", scores["score"])

    def test_a_fault_of_the_method_is_raised(self):
        class Faulty(Direct):
            def tick(self, hip, t):
                raise ZeroDivisionError("of mine")

        class Endless(Direct):
            def tick(self, hip, t):
                return hip, numpy.full(3, numpy.inf)

        class Forgetful:
            def frame(self, cloud, stamp):
                pass

        class Keeper(Direct):
            def frame(self, cloud, stamp):
                self.cloud = getattr(self, "cloud", cloud)  # of another time

        with self.assertRaisesRegex(ZeroDivisionError, "of mine"):
            palpate.bench.pop(Faulty(), cases=1, families=["hold"])
        press = {"camera": "synthetic:desk?size=80x60", "press": (40, 30)}
        with self.assertRaisesRegex(ZeroDivisionError, "of mine"):
            palpate.trace(method=Faulty(), **press)
        with self.assertRaisesRegex(palpate.Error, "not finite"):
            palpate.trace(method=Endless(), **press)
        with self.assertRaisesRegex(palpate.Error, "no function tick"):
            palpate.trace(method=Forgetful(), **press)
        with self.assertRaisesRegex(palpate.Error, "newer frame"):
            palpate.trace(method=Keeper(), **press)

    def test_an_entry_of_a_method_in_python_holds(self):
        class Nothing(palpate.Method):
            def frame(self, cloud, stamp):
                self.seen = True

            def tick(self, hip, t):
                return hip, numpy.full(3, 0.0 if self.seen else numpy.nan)

        with tempfile.TemporaryDirectory() as folder:
            file = f"{folder}/entry.json"
            entry = palpate.bench.entry(Nothing(), file, seed=5, cases=1, repeats=1)
            self.assertEqual((entry["method"], entry["kind"]), ("Nothing", "python"))
            self.assertEqual(entry["command"], "palpate.bench.entry(Nothing(), seed=5, cases=1, "
                                               "repeats=1, recordings=[])")
            self.assertLess(entry["scores"]["score"]["value"], 10, "it feels nothing")
            self.assertIn("no recording", entry["scores"]["real"])
            self.assertTrue(palpate.bench.check(file, Nothing, sample=3)["holds"])
            with self.assertRaisesRegex(palpate.Error, "palpate.bench.check"):
                palpate.bench.check(file)

    def test_refuses_what_it_does_not_know(self):
        self.assertIn("god-object", palpate.bench.methods())
        with self.assertRaisesRegex(palpate.Error, "no such method"):
            palpate.bench.pop("god", cases=1)
        with self.assertRaisesRegex(palpate.Error, "no such family"):
            palpate.bench.pop("paper", cases=1, families=["holds"])


if __name__ == "__main__":
    unittest.main()
