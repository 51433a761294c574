"""Tests of the package svl_bench as the wheel installs it: packaging/python-test.sh."""

import importlib.util
import math
import os
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import svl_bench as svl

WIDTH, HEIGHT = 160, 96
RIG = svl.Rig(focal_px=170, baseline_m=0.06, cx_px=80, cy_px=48)


def pair(shift=9, size=(WIDTH, HEIGHT)):
    """A textured plane of that disparity, with a nearer square."""
    width, height = size
    noise = np.random.default_rng(7).integers(0, 256, (height, width + 64), np.uint8)
    left = noise[:, :width].copy()
    right = noise[:, shift : width + shift].copy()
    right[30:60, 40:80] = left[30:60, 60:100]
    return left, right


def svl_program(*words):
    ran = subprocess.run([svl.program(), *map(str, words)], capture_output=True, text=True)
    if ran.returncode:
        raise AssertionError(ran.stderr)
    return ran.stdout


def write_pgm(path, image):
    path.write_bytes(b"P5 %d %d 255\n" % image.shape[::-1] + image.tobytes())


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def fails(self, error, *words):
        return self.assertRaisesRegex(error, ".*".join(words))


class Matching(InFolder):
    def test_the_bytes_are_those_of_the_program(self):
        left, right = pair()
        write_pgm(self.folder / "l.pgm", left)
        write_pgm(self.folder / "r.pgm", right)
        images = [self.folder / "l.pgm", self.folder / "r.pgm"]
        for algorithm in ["v5", "v3:max_disparity=32", "sgm", "bm"]:
            out = self.folder / f"{algorithm[:2]}.pfm"
            svl_program("match", *images, "--algo", algorithm, "-o", out)
            found = svl.match(left, right, algorithm, rig=RIG)
            written = out.read_bytes()
            self.assertTrue(np.isfinite(found.disparity).any())
            self.assertTrue(written.startswith(b"Pf\n160 96\n"), written[:20])
            self.assertTrue(written.endswith(found.disparity[::-1].astype("<f4").tobytes()), algorithm)
            self.assertTrue((np.isinf(found.disparity) == (found.reasons != 0)).all())

    def test_cells_have_shapes_types_and_distances(self):
        left, right = pair()
        found = svl.match(left, right, "v5", rig=RIG, columns=6, rows=4)
        for cells in found[:6]:
            self.assertEqual(cells.shape, (4, 6))
        kinds = [str(array.dtype) for array in found]
        self.assertEqual(kinds, ["float32"] * 4 + ["uint8"] * 2 + ["float32", "uint8"])
        known = found.state == svl.State.KNOWN
        self.assertGreater(known.sum(), 4)
        distance = RIG.focal_px * RIG.baseline_m / found.disparity_px[known]
        np.testing.assert_allclose(found.distance_m[known], distance, rtol=1e-5)
        self.assertTrue(np.isnan(found.distance_m[found.state == svl.State.UNKNOWN]).all())
        self.assertEqual(svl.REASONS[0], "valid")
        without = svl.match(left, right, "v5")
        self.assertTrue(np.isnan(without.distance_m).all())

    def test_views_colours_and_sixteen_bits_are_the_same_image(self):
        left, right = pair()
        expected = svl.match(left, right).disparity
        wide = np.zeros((HEIGHT, WIDTH + 13), np.uint8)
        wide[:, 5 : WIDTH + 5] = left
        view = wide[:, 5 : WIDTH + 5]
        np.testing.assert_array_equal(svl.match(view, right).disparity, expected)
        odd = svl.match(np.repeat(left, 2, axis=0)[::2], right)
        np.testing.assert_array_equal(odd.disparity, expected)
        deep = [image.astype(np.uint16) << 4 for image in (left, right)]
        np.testing.assert_array_equal(svl.match(*deep, bits=12).disparity, expected)
        color = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
        blue_first = color[..., ::-1].copy()
        np.testing.assert_array_equal(
            svl.match(color, right).disparity, svl.match(blue_first, right, bgr=True).disparity
        )

    def test_the_images_are_not_changed_and_answers_are_the_callers(self):
        left, right = pair()
        copies = left.copy(), right.copy()
        with svl.Ranger("v5", rig=RIG) as ranger:
            first = ranger.match(left, right, stamp_ns=1)
            kept = [array.copy() for array in first]
            first_again = ranger.match(right, left, stamp_ns=2)
        np.testing.assert_array_equal(left, copies[0])
        np.testing.assert_array_equal(right, copies[1])
        for array, copy in zip(first, kept):
            np.testing.assert_array_equal(array, copy)
        self.assertFalse(np.array_equal(first_again.disparity, first.disparity))

    def test_match_has_no_memory_and_a_ranger_forgets(self):
        pairs = [pair(5), pair(20)]
        alone = [svl.match(*images) for images in pairs]
        again = [svl.match(*images) for images in reversed(pairs)][::-1]
        with svl.Ranger() as ranger:
            fresh = []
            for images in pairs:
                ranger.reset()
                fresh.append(ranger.match(*images))
        for found in zip(alone, again, fresh):
            for arrays in zip(*found):
                np.testing.assert_array_equal(arrays[0], arrays[1])
                np.testing.assert_array_equal(arrays[0], arrays[2])

    def test_raw_images_are_rectified_by_a_calibration(self):
        path = self.folder / "calib.txt"
        camera = "[170 0 80; 0 170 48; 0 0 1]"
        path.write_text(
            f"cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline=60\nwidth={WIDTH}\nheight={HEIGHT}\nndisp=64\n"
        )
        by_file = svl.match(*pair(), calibration=path)
        np.testing.assert_array_equal(by_file.distance_m, svl.match(*pair(), rig=RIG).distance_m)
        with self.fails(ValueError, "name one"):
            svl.Ranger(calibration=path, rig=RIG)
        with self.fails(FileNotFoundError, "nothing.yaml"):
            svl.match(*pair(), calibration="nothing.yaml")

    def test_other_threads_run_meanwhile(self):
        left, right = pair(size=(1280, 960))
        counted, done = 0, threading.Event()

        def work():
            svl.match(left, right, "sgm", threads=1)
            done.set()

        thread = threading.Thread(target=work)
        thread.start()
        while not done.is_set():
            counted += 1
            time.sleep(0.001)
        thread.join()
        self.assertGreater(counted, 3)

    def test_a_ranger_serves_several_threads_in_turns(self):
        left, right = pair()
        expected = svl.match(left, right, "bm").disparity
        with svl.Ranger("bm") as ranger:
            found = []
            threads = [
                threading.Thread(target=lambda: found.append(ranger.match(left, right)))
                for _ in range(4)
            ]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertEqual(len(found), 4)
        for each in found:
            np.testing.assert_array_equal(each.disparity, expected)


class BadInput(InFolder):
    def test_images_that_are_none(self):
        left, right = pair()
        for wrong, error, words in [
            (left.astype(np.float32), TypeError, ["left", "uint8 or uint16", "float32"]),
            (left.astype(">u2"), TypeError, ["left", ">u2"]),
            (left.tolist(), TypeError, ["left", "list"]),
            (None, TypeError, ["left", "NoneType"]),
            (left[0], ValueError, ["left", r"\[160\]"]),
            (np.zeros((9, 9, 2), np.uint8), ValueError, ["left", r"\[9, 9, 2\]"]),
            (np.zeros((9, 9, 3), np.uint16), ValueError, ["left", r"\[9, 9, 3\]"]),
            (np.zeros((0, 9), np.uint8), ValueError, ["left", "9x0"]),
            (left[:, ::2], ValueError, ["left", "strides", "ascontiguousarray"]),
            (left[::-1], ValueError, ["left", "strides", "ascontiguousarray"]),
            (left.T, ValueError, ["left", "strides", "ascontiguousarray"]),
            (np.broadcast_to(left[0], left.shape), ValueError, ["left", "strides"]),
            (left[:-1], ValueError, ["160x95", "160x96"]),
        ]:
            with self.subTest(words=words), self.fails(error, *words):
                svl.match(wrong, right)
        with self.fails(TypeError, "right", "float64"):
            svl.match(left, right.astype(float))
        deep = left.astype(np.uint16)
        with self.fails(ValueError, "left", "17", "8 to 16"):
            svl.match(deep, deep, bits=17)
        # The next pair goes on.
        self.assertEqual(svl.match(left, right).disparity.shape, left.shape)

    def test_options(self):
        for options, words in [
            ({"algorithm": "v6"}, ["v6"]),
            ({"algorithm": "v5:max_disparity=zero"}, ["max_disparity"]),
            ({"rig": (0, 1)}, ["focal"]),
            ({"rows": 0}, ["0"]),
            ({"columns": 65}, ["65"]),
            ({"threads": 100000}, ["100000 threads"]),
        ]:
            with self.subTest(words=words), self.fails(ValueError, *words):
                svl.Ranger(**options)
        with self.fails(OSError, "none.svlf"):
            svl.Ranger(filters=["none.svlf"])

    def test_a_closed_ranger(self):
        ranger = svl.Ranger()
        ranger.close()
        ranger.close()
        with self.fails(ValueError, "closed"):
            ranger.match(*pair())
        with self.fails(ValueError, "closed"):
            ranger.reset()

    @unittest.skipUnless(hasattr(os, "fork"), "no fork")
    def test_a_fork(self):
        ranger = svl.Ranger()
        expected = svl.match(*pair()).disparity
        ranger.match(*pair())
        child = os.fork()
        if child == 0:
            status = 1
            try:
                try:
                    ranger.match(*pair())
                except RuntimeError as error:
                    if "open one in each process" in str(error):
                        status = 2
                del ranger
                if status == 2 and np.array_equal(svl.match(*pair()).disparity, expected):
                    status = 0
            finally:
                os._exit(status)
        status = None
        for _ in range(300):
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                break
            time.sleep(0.1)
        else:
            os.kill(child, 9)
            self.fail("the child hangs")
        self.assertEqual(os.waitstatus_to_exitcode(status), 0)
        self.assertEqual(ranger.match(*pair()).disparity.shape, (HEIGHT, WIDTH))


class Program(InFolder):
    def test_record_score_report_and_compare(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=4, seed=2)
        self.assertTrue(recording.is_file())
        with self.fails(RuntimeError, "a.mcap: exists already"):
            svl.record("arena", recording, frames=4)
        with self.fails(ValueError, "--no-such"):
            svl.record("arena", self.folder / "b.mcap", no_such=1)
        report = svl.score(recording, ["v5", "bm"], output=self.folder / "r")
        names = [row["algorithm"] for row in report.data["algorithms"]]
        self.assertEqual(sorted(names), ["bm", "v5"])
        self.assertEqual(svl.report(self.folder / "r").data, report.data)
        self.assertIn("v5", str(report))
        self.assertEqual(report._repr_markdown_(), str(report))
        self.assertIsNone(report.gate_passed)
        with self.fails(ValueError, "not one of svl's reports"):
            svl.report(self.folder)
        other = svl.score(recording, "v5", output=self.folder / "s")
        (compared,) = svl.compare(report, other)
        self.assertEqual(compared["other"], str(self.folder / "s"))
        with self.fails((ValueError, RuntimeError), "nothing"):
            svl.compare(report, self.folder / "nothing")

    def test_the_gate_is_in_the_report(self):
        scenario = self.folder / "two.toml"
        for most, passes in [(1, True), (0, False)]:
            scenario.write_text(
                'name = "two"\n[source]\nkind = "arena"\n[arena]\nframes = 2\n'
                f'[[gate]]\nalgorithm = "v5"\nmetric = "unknown"\nmax = {most}\n'
            )
            report = svl.score(scenario, output=self.folder / f"r{most}", gate=True)
            self.assertIs(report.gate_passed, passes)

    @unittest.skipUnless(
        all(importlib.util.find_spec(name) for name in ["mcap", "mcap_protobuf", "mcap_ros2", "PIL", "pandas"]),
        "no Python with mcap, pandas",
    )
    def test_read_and_tables(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=3)
        pairs = list(svl.read(recording))
        self.assertEqual([pair.sequence for pair in pairs], [0, 1, 2])
        with self.fails(RuntimeError, "none.bag"):
            next(svl.read(self.folder / "none.bag"))
        cells = svl.score(recording, "v5", output=self.folder / "r").tables()["cells"]
        # A ranger answers what the bench scores. The arena's cameras see 52 degrees.
        focal_px = 160 / math.tan(math.radians(26))
        rig = svl.Rig(focal_px, 0.044, cx_px=159.5, cy_px=119.5)
        with svl.Ranger("v5", rig=rig) as ranger:
            for pair in pairs:
                found = ranger.match(pair.left, pair.right, stamp_ns=pair.stamp_ns)
                scored = cells[cells["sequence"] == pair.sequence].sort_values(["row", "column"])
                for mine, column in [
                    (found.probability, "probability"),
                    (found.distance_m, "distance_m"),
                    (found.valid_fraction, "valid_share"),
                ]:
                    theirs = scored[column].to_numpy(np.float32).reshape(3, 5)
                    np.testing.assert_array_equal(mine, theirs, column)
        self.assertTrue((cells["probability"] > 0.5).any())


if __name__ == "__main__":
    unittest.main()
