"""Tests of the package svl_bench as the wheel installs it: packaging/python-test.sh."""

import ast
import contextlib
import importlib.util
import io
import json
import multiprocessing
import os
import pydoc
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import types
import unittest
from pathlib import Path

import numpy as np
import svl_bench as svl

ROOT = Path(__file__).resolve().parents[2]
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


class Lent:
    """An image of another library, as PIL's, which lends its array to numpy."""

    def __init__(self, image):
        self.__array_interface__ = image.__array_interface__
        self.image = image


def has(*modules):
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    return unittest.skipIf(missing, f"no Python with {', '.join(missing)}")


def python(code, folder=None):
    """The output of a Python of its own."""
    line = [sys.executable, "-c", code]
    ran = subprocess.run(line, capture_output=True, text=True, cwd=folder)
    if ran.returncode:
        raise AssertionError(ran.stderr)
    return ran.stdout


def svl_processes():
    """The processes of svl that this one started."""
    tasks = Path("/proc/self/task").iterdir()
    started = [int(pid) for task in tasks for pid in (task / "children").read_text().split()]
    return [pid for pid in started if Path(f"/proc/{pid}/comm").read_text() == "svl\n"]


def resident_bytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def write_pgm(path, image):
    path.write_bytes(b"P5 %d %d 255\n" % image.shape[::-1] + image.tobytes())


def write_opencv_calibration(path):
    """Two cameras with distortion, 60 mm apart, as OpenCV's FileStorage writes them."""
    def matrix(name, rows, columns, numbers):
        return (
            f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n"
            f"   data: [ {', '.join(map(str, numbers))} ]\n"
        )

    camera = [170.0, 0.0, 80.0, 0.0, 170.0, 48.0, 0.0, 0.0, 1.0]
    lens = [-0.1, 0.02, 0.0, 0.0, 0.0]
    path.write_text(
        "%YAML:1.0\n---\n"
        f"image_width: {WIDTH}\nimage_height: {HEIGHT}\nlength_unit: m\n"
        + matrix("M1", 3, 3, camera) + matrix("D1", 1, 5, lens)
        + matrix("M2", 3, 3, camera) + matrix("D2", 1, 5, lens)
        + matrix("R", 3, 3, [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]) + matrix("T", 3, 1, [-0.06, 0.0, 0.0])
    )  # fmt: skip


def write_raw_bag(path, images, distortion):
    """A ROS 2 bag of a pair and its cameras, by rosbags, which knows nothing of svl."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](1_700_000_000, 0)
    header = types["std_msgs/msg/Header"](stamp, "camera")
    focal, _, cx, cy, _ = RIG
    roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for side, image, shift in zip(["left", "right"], images, [0.0, -focal * RIG.baseline_m]):
            coefficients = np.array([distortion, 0, 0, 0, 0], float)
            k = np.array([focal, 0, cx, 0, focal, cy, 0, 0, 1], float)
            p = np.array([focal, 0, cx, shift, 0, focal, cy, 0, 0, 0, 1, 0], float)
            messages = {
                "image_raw": types["sensor_msgs/msg/Image"](
                    header, HEIGHT, WIDTH, "mono8", 0, WIDTH, image.reshape(-1)
                ),
                "camera_info": types["sensor_msgs/msg/CameraInfo"](
                    header, HEIGHT, WIDTH, "plumb_bob", coefficients, k, np.eye(3).reshape(-1), p, 0, 0, roi
                ),
            }
            for topic, message in messages.items():
                kind = message.__msgtype__
                connection = writer.add_connection(f"/{side}/{topic}", kind, typestore=store)
                data = store.serialize_cdr(message, kind)
                writer.write(connection, 1_700_000_000_000_000_000, data)


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
            # None is NaN in Python, infinite in the file.
            shown = np.where(np.isnan(found.disparity), np.inf, found.disparity)
            self.assertTrue(written.endswith(shown[::-1].astype("<f4").tobytes()), algorithm)
            self.assertTrue((np.isnan(found.disparity) == (found.reasons != 0)).all())
            self.assertFalse(np.isinf(found.disparity).any())

    def test_cells_have_shapes_types_and_distances(self):
        left, right = pair()
        found = svl.match(left, right, "v5", rig=RIG, columns=6, rows=4)
        for cells in found[:6]:
            self.assertEqual(cells.shape, (4, 6))
        self.assertEqual(found.rig, RIG)
        kinds = [str(array.dtype) for array in found[:12]]
        self.assertEqual(kinds, ["float32"] * 4 + ["uint8"] * 3 + ["float32"] * 4 + ["uint8"])
        known = found.state == svl.State.KNOWN
        self.assertGreater(known.sum(), 4)
        distance = RIG.focal_px * RIG.baseline_m / found.disparity_px[known]
        np.testing.assert_allclose(found.distance_m[known], distance, rtol=1e-5)
        self.assertTrue(np.isnan(found.distance_m[found.state == svl.State.UNKNOWN]).all())
        self.assertEqual((svl.REASONS[0], svl.REASONS[8]), ("valid", "disagreement"))
        same = svl.match(left, left, "v5", rig=RIG)
        self.assertTrue((same.state == svl.State.FAR).any())
        np.testing.assert_array_equal(same.state == svl.State.FAR, np.isposinf(same.distance_m))
        without = svl.match(left, right, "v5")
        self.assertTrue(np.isnan(without.distance_m).all())

    def test_pixels_have_distances_and_points(self):
        found = svl.match(*pair(), "bm", rig=RIG)
        known = np.isfinite(found.disparity)
        depth = found.depth_m
        np.testing.assert_array_equal(np.isnan(depth), ~known)
        expected = 170 * 0.06 / found.disparity[known].astype(float)
        np.testing.assert_allclose(depth[known], expected, rtol=1e-6)
        self.assertAlmostEqual(float(np.nanmedian(found.disparity)), 9, places=1)
        points = found.points()
        self.assertEqual((points.dtype, points.shape), (np.float32, (known.sum(), 3)))
        y, x = np.nonzero(known)
        np.testing.assert_allclose(points[:, 0] * 170 / points[:, 2] + 80, x, atol=1e-3)
        np.testing.assert_allclose(points[:, 1] * 170 / points[:, 2] + 48, y, atol=1e-3)
        far = found._replace(disparity=np.zeros((2, 2), np.float32))
        self.assertTrue(np.isposinf(far.depth_m).all())
        self.assertEqual(far.points().shape, (0, 3))
        without = svl.match(*pair(), "bm")
        self.assertTrue(np.isnan(without.depth_m).all())
        with self.fails(ValueError, "rig=", "calibration="):
            without.points()

    def test_views_colours_and_sixteen_bits_are_the_same_image(self):
        left, right = pair()
        expected = svl.match(left, right).disparity
        wide = np.zeros((HEIGHT, WIDTH + 13), np.uint8)
        wide[:, 5 : WIDTH + 5] = left
        view = wide[:, 5 : WIDTH + 5]
        np.testing.assert_array_equal(svl.match(view, right).disparity, expected)
        odd = svl.match(np.repeat(left, 2, axis=0)[::2], right)
        np.testing.assert_array_equal(odd.disparity, expected)
        for same, scale in [
            (left.tolist(), None),
            (left[..., None], None),
            (np.asfortranarray(left), None),
            (left[::-1].copy()[::-1], None),
            (np.repeat(left, 2, axis=1)[:, ::2], None),
            (left.astype(np.int64), None),
            (left / 255, 255),
            (left.astype(np.float32), 1),
            (Lent(left), None),
        ]:
            other = right if scale is None else right / np.float64(scale)
            found = svl.match(same, other, scale=scale)
            np.testing.assert_array_equal(found.disparity, expected)
        swapped = [(image.astype(np.uint16) << 2).astype(">u2") for image in (left, right)]
        np.testing.assert_array_equal(svl.match(*swapped, bits=10).disparity, expected)
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
            kept = [array.copy() for array in first[:12]]
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

    def test_a_calibration_rectifies_what_a_ranger_rectifies(self):
        path = self.folder / "camera.yml"
        write_opencv_calibration(path)
        calibration = svl.calibration(path)
        self.assertAlmostEqual(calibration.rig.baseline_m, 0.06, places=4)
        self.assertEqual(calibration.size, (WIDTH, HEIGHT))
        left, right = pair()
        rectified = calibration.rectify(left, right)
        self.assertFalse(np.array_equal(rectified[0], left))
        by_file = svl.match(left, right, "bm", calibration=path)
        self.assertEqual(by_file.rig, calibration.rig)
        found = svl.match(*rectified, "bm", rig=calibration.rig)
        np.testing.assert_array_equal(by_file.disparity, found.disparity)
        colours = [np.stack([image, image // 2, image], -1) for image in (left, right)]
        coloured = calibration.rectify(*colours)
        self.assertEqual(coloured[0].shape, (HEIGHT, WIDTH, 3))
        for grey, colour in zip(rectified, coloured):
            np.testing.assert_array_equal(colour[..., 0], grey)
            np.testing.assert_array_equal(colour[..., 2], grey)
        deep = [image.astype(np.uint16) << 2 for image in (left, right)]
        for grey, same in zip(rectified, calibration.rectify(*deep, bits=10)):
            np.testing.assert_array_equal(same, grey)
        with self.fails(ValueError, "bits"):
            calibration.rectify(*deep)
        with self.fails(ValueError, f"{WIDTH}x{HEIGHT}", "80x96"):
            calibration.rectify(left[:, ::2], right[:, ::2])
        with self.fails(ValueError, "both grey, or both colour"):
            calibration.rectify(left, colours[1])
        with self.fails(ValueError, "other.yml"):
            (self.folder / "other.yml").write_text("nothing")
            svl.calibration(self.folder / "other.yml")

    def test_files_of_a_calibration_are_read_again_where_they_change(self):
        def write(path, baseline_m):
            projection = f"[170.0, 0.0, 80.0, {-170 * baseline_m}, 0.0, 170.0, 48.0, 0.0, 0.0, 0.0, 1.0, 0.0]"
            path.write_text(
                f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_name: c\n"
                "camera_matrix: {rows: 3, cols: 3, data: [170.0, 0.0, 80.0, 0.0, 170.0, 48.0, 0.0, 0.0, 1.0]}\n"
                "distortion_model: plumb_bob\n"
                "distortion_coefficients: {rows: 1, cols: 5, data: [0.0, 0.0, 0.0, 0.0, 0.0]}\n"
                "rectification_matrix: {rows: 3, cols: 3, data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}\n"
                f"projection_matrix: {{rows: 3, cols: 4, data: {projection}}}\n"
            )

        folder = self.folder / "calibration"
        folder.mkdir()
        write(folder / "left.yaml", 0)
        depths = []
        for baseline_m in (0.06, 0.12):
            write(folder / "right.yaml", baseline_m)
            depths.append(np.nanmedian(svl.match(*pair(), "bm", calibration=folder).distance_m))
        self.assertAlmostEqual(depths[1] / depths[0], 2, places=3)

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


    @unittest.skipUnless(Path("/proc/self/statm").exists(), "no /proc")
    def test_memory_does_not_grow(self):
        left, right = pair()
        for _ in range(50):
            svl.match(left, right, rig=RIG)
        before = resident_bytes()
        for _ in range(1000):
            svl.match(left, right, rig=RIG)
        self.assertLess(resident_bytes() - before, 4e6)


def forked(_):
    return svl.match(*pair()).disparity


class BadInput(InFolder):
    def test_images_that_are_none(self):
        left, right = pair()
        for wrong, error, words in [
            (left.astype(np.float32), TypeError, ["left", "float32", "scale="]),
            (left.astype(np.int32) - 9, ValueError, ["left", "from -9 to", "0 to 255"]),
            ([[300, 1], [2, 3]], ValueError, ["left", "to 300", "bits="]),
            (left > 9, TypeError, ["left", "an array of bool"]),
            (None, TypeError, ["left", "NoneType"]),
            ("left.png", TypeError, ["left", "str"]),
            ([], ValueError, ["left", "no pixels"]),
            (left[0], ValueError, ["left", r"\[160\]"]),
            (np.zeros((9, 9, 2), np.uint8), ValueError, ["left", r"\[9, 9, 2\]"]),
            (np.zeros((9, 9, 3), np.uint16), ValueError, ["left", r"\[9, 9, 3\]"]),
            (np.zeros((0, 9), np.uint8), ValueError, ["left", "no pixels"]),
            (left[:, ::2], ValueError, ["80x96", "160x96"]),
            (left[:-1], ValueError, ["160x95", "160x96"]),
        ]:
            with self.subTest(words=words), self.fails(error, *words):
                svl.match(wrong, right)
        with self.fails(TypeError, "right", "float64"):
            svl.match(left, right.astype(float))
        with self.fails(TypeError, "left", "scale="):
            svl.match(left, right, scale=255)
        with self.fails(ValueError, "right", "not finite"):
            svl.match(left / 255, np.full(right.shape, np.nan), scale=255)
        deep = left.astype(np.uint16)
        for bits in [17, 300, -1]:
            with self.fails(ValueError, str(bits), "8 to 16"):
                svl.match(deep, deep, bits=bits)
        # Sixteen bits would be assumed wrongly of most cameras.
        with self.fails(ValueError, "left", "bits=N", "mono10"):
            svl.match(deep, deep)
        with svl.Ranger() as ranger, self.fails(ValueError, "stamp_ns=-1"):
            ranger.match(left, right, stamp_ns=-1)
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
            ({"threads": -1}, ["threads=-1: expected 0 or more"]),
            ({"columns": -5}, ["columns=-5: expected 1 to 64"]),
        ]:
            with self.subTest(words=words), self.fails(ValueError, *words):
                svl.Ranger(**options)
        with self.fails(OSError, "none.svlf"):
            svl.Ranger(filters=["none.svlf"])

    @unittest.skipUnless(hasattr(os, "fork"), "needs limits of memory")
    def test_lack_of_memory_is_an_exception(self):
        code = """if 1:
            import resource, numpy as np, svl_bench as svl
            image = np.zeros((2000, 3000), np.uint8)
            ranger = svl.Ranger(threads=2)
            size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (size + 100_000_000, resource.RLIM_INFINITY))
            try:
                ranger.match(image, image)
            except MemoryError as error:
                print(error)
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
            print(ranger.match(image, image).disparity.shape)
        """
        error, shape = python(code).splitlines()
        self.assertRegex(error, "no memory: at least .* MB more are needed; smaller images")
        self.assertEqual(shape, "(2000, 3000)")

    def test_a_closed_ranger(self):
        ranger = svl.Ranger()
        ranger.close()
        ranger.close()
        with self.fails(ValueError, "closed"):
            ranger.match(*pair())
        with self.fails(ValueError, "closed"):
            ranger.reset()

    def test_an_error_is_its_thread_s_alone(self):
        left, right = pair()
        expected = svl.match(left, right).disparity
        found = {}

        def work(i):
            try:
                found[i] = svl.match(left, right[: HEIGHT - i % 2]).disparity
            except ValueError as error:
                found[i] = error

        threads = [threading.Thread(target=work, args=[i]) for i in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for i in range(6):
            if i % 2:
                self.assertIn("160x95", str(found[i]))
            else:
                np.testing.assert_array_equal(found[i], expected)

    @unittest.skipUnless(hasattr(os, "fork"), "no fork")
    def test_a_pool_of_processes(self):
        expected = svl.match(*pair()).disparity
        with multiprocessing.get_context("fork").Pool(2) as pool:
            found = pool.map_async(forked, range(4)).get(timeout=60)
        for disparity in found:
            np.testing.assert_array_equal(disparity, expected)

    @unittest.skipUnless(hasattr(os, "fork"), "no fork")
    def test_a_fork(self):
        ranger = svl.Ranger()
        expected = svl.match(*pair()).disparity
        ranger.match(*pair())
        write_opencv_calibration(self.folder / "camera.yml")
        calibration = svl.calibration(self.folder / "camera.yml")
        rectified = calibration.rectify(*pair())
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
                again = svl.match(*pair()).disparity
                if status == 2 and np.array_equal(again, expected, equal_nan=True):
                    again = calibration.rectify(*pair())
                    status = 0 if np.array_equal(again, rectified) else 3
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


def interrupted_after(seconds, call):
    """How long after Ctrl-C the call ended."""
    sent = []

    def interrupt():
        time.sleep(seconds)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    try:
        call()
    except KeyboardInterrupt:
        return time.monotonic() - sent[0]
    finally:
        thread.join()
    raise AssertionError("no KeyboardInterrupt")


class Interrupts(InFolder):
    def test_a_match_is_left_and_its_ranger_goes_on(self):
        large = pair(size=(1600, 1200))
        with svl.Ranger("sgm:max_disparity=255", threads=1) as ranger:
            began = time.monotonic()
            ranger.match(*large)
            alone = time.monotonic() - began
            # A tenth of it is more than the 50 ms between two looks.
            if alone > 1:
                self.assertLess(interrupted_after(0.1, lambda: ranger.match(*large)), alone / 2)
            small = ranger.match(*pair())
        expected = svl.match(*pair(), "sgm:max_disparity=255").disparity
        np.testing.assert_array_equal(small.disparity, expected)

    @unittest.skipUnless(Path("/proc/self/task").exists(), "no /proc")
    def test_a_ranger_may_be_closed_while_a_pair_that_was_left_is_matched(self):
        code = """if 1:
            import os, signal, threading, time, numpy as np, svl_bench as svl
            threads = lambda: len(os.listdir('/proc/self/task'))
            before = threads()
            image = np.random.default_rng(1).integers(0, 256, (1200, 1600), np.uint8)
            ranger = svl.Ranger('sgm:max_disparity=255', threads=1)
            threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT]).start()
            try:
                ranger.match(image, image)
            except KeyboardInterrupt:
                print('left')
            ranger.close()
            for _ in range(600):
                if threads() <= before:
                    print('ended')
                    break
                time.sleep(0.1)
        """
        self.assertEqual(python(code).split(), ["left", "ended"])

    def test_a_score_ends_orderly(self):
        output = self.folder / "r"
        interrupted_after(1, lambda: svl.score("arena", "v5", output=output, seeds="1..40"))
        self.assertEqual(svl_processes(), [])
        with self.assertRaises((FileNotFoundError, ValueError)):
            svl.report(output)


class Evaluation(InFolder):
    def test_an_array_is_as_good_as_its_file(self):
        left, right = pair()
        found = svl.match(left, right, rig=RIG).disparity
        truth = np.full(left.shape, 9, np.float32)
        truth[:, :9] = np.nan
        mask = np.zeros(left.shape, bool)
        mask[20:80, 20:140] = True
        for name, array in [("d", found), ("t", truth)]:
            np.save(self.folder / f"{name}.npy", array)
        write_pgm(self.folder / "m.pgm", np.where(mask, 255, 0).astype(np.uint8))
        files = [self.folder / "d.npy", self.folder / "t.npy"]
        for protocol in ["middeval3", "middlebury-v2", "eth3d", "kitti12", "kitti15"]:
            for options, given in [([], None), (["--mask", self.folder / "m.pgm"], mask)]:
                line = ["eval", *files, "--protocol", protocol, "--json", *options]
                expected = json.loads(svl_program(*line))
                scores = svl.evaluate(found, truth, protocol=protocol, mask=given)
                self.assertEqual(scores, {name: expected[name] for name in scores})
                self.assertEqual(set(expected) - set(scores) - {"doubts", "images"}, {"protocol"})
        scores = svl.evaluate(found, truth)
        self.assertEqual(scores["pixels"], int(np.isfinite(truth).sum()))
        self.assertEqual(svl.evaluate(found, truth, max_disparity=4)["bad4.0"], 100 - scores["invalid"])

    def test_with_a_rig_it_tells_of_distances(self):
        truth = np.full((4, 5), 10, np.float32)
        found = truth.copy()
        found[0] = 8
        found[1] = np.nan
        scores = svl.evaluate(found, truth, rig=RIG, protocol="kitti15")
        depth = RIG.focal_px * RIG.baseline_m / np.array([10, 8])
        error = depth[1] - depth[0]
        self.assertAlmostEqual(scores["rmse_m"], error * (1 / 3) ** 0.5, places=6)
        self.assertEqual(scores["median_error_m"], 0)
        self.assertAlmostEqual(scores["abs_rel"], error / depth[0] / 3, places=6)
        nothing = svl.evaluate(np.full((4, 5), np.nan), truth, rig=RIG)
        self.assertIsNone(nothing["rmse_m"])
        # Depths of a depth camera, where 0 is none.
        metres = np.where(np.arange(20).reshape(4, 5) == 3, 0, depth[0])
        by_depth = svl.evaluate(truth, RIG.disparity_px(metres), rig=RIG)
        self.assertEqual(by_depth["pixels"], 19)
        self.assertAlmostEqual(by_depth["rmse_m"], 0, places=5)

    def test_integers_say_their_factor(self):
        truth = np.full((4, 5), 2560, np.uint16)
        truth[0, 0] = 0
        found = np.full((4, 5), 168, np.int16)
        found[1, 1] = -16
        scores = svl.evaluate(found, truth, disparity_scale=256, estimate_scale=16)
        self.assertEqual((scores["pixels"], scores["bad0.5"], scores["avgerr"]), (19, 0, 0.5))
        self.assertAlmostEqual(scores["invalid"], 100 / 19, places=4)
        self.assertEqual(svl.evaluate([[1, 1]], [[1, 2]], protocol="eth3d")["avgerr"], 0.5)
        masked = np.ma.masked_array(np.full((4, 5), 10.0), mask=truth == 0)
        self.assertEqual(svl.evaluate(np.full((4, 5), 10), masked)["pixels"], 19)
        for wrong, error, words in [
            ([found, truth], ValueError, ["disparity", "int16", "estimate_scale="]),
            ([found[0] / 16, truth / 256], ValueError, ["disparity", "height x width"]),
            ([np.zeros((0, 4)), truth / 256], ValueError, ["disparity", "height x width"]),
            ([None, truth / 256], TypeError, ["disparity", "object"]),
            ([np.ones((4, 4)), truth / 256], ValueError, ["4x4", "5x4"]),
        ]:
            with self.subTest(words=words), self.fails(error, *words):
                svl.evaluate(*wrong)
        with self.fails(ValueError, "mask", r"\(2, 2\)"):
            svl.evaluate(truth / 256, truth / 256, mask=[[1, 0], [0, 1]])
        with self.fails(ValueError, "kitti16"):
            svl.evaluate(truth / 256, truth / 256, protocol="kitti16")
        with self.fails(FileNotFoundError, "gone.png"):
            svl.evaluate(truth / 256, truth / 256, protocol="kitti15", object_map="gone.png")


class Writing(InFolder):
    def test_pairs_that_are_read_are_written(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=3)
        pairs = list(svl.read(recording))
        own = svl.write(self.folder / "own.mcap", pairs)
        again = list(svl.read(own))
        self.assertEqual(len(again), 3)
        for one, other in zip(pairs, again):
            self.assertEqual(one.stamp_ns, other.stamp_ns)
            np.testing.assert_array_equal(one.left, other.left)
            np.testing.assert_array_equal(one.right, other.right)
            np.testing.assert_allclose(one.rig, other.rig, rtol=1e-12)
            np.testing.assert_allclose(one.true_disparity, other.true_disparity, rtol=1e-3)
        self.assertEqual(sorted(os.listdir(self.folder)), ["a.mcap", "own.mcap"])
        self.assertEqual(svl.info(own)["header"]["source"], "pairs")
        with self.fails(RuntimeError, "own.mcap", "exists already"):
            svl.write(own, pairs)
        svl.write(own, pairs[:1], force=True)
        self.assertEqual(len(list(svl.read(own))), 1)

    def test_pairs_of_a_camera_are_written(self):
        left, right = pair()
        stamps = [1_700_000_000_000_000_000 + i * 33_000_000 for i in range(3)]
        lefts, rights = [left, left // 2, left], [right, right // 2, right]
        own = svl.write(self.folder / "own.mcap", zip(lefts, rights, stamps), rig=RIG)
        pairs = list(svl.read(own))
        self.assertEqual([p.stamp_ns for p in pairs], stamps)
        np.testing.assert_array_equal(pairs[1].left, left // 2)
        np.testing.assert_allclose(pairs[0].rig, RIG)
        self.assertIsNone(pairs[0].true_disparity)
        self.assertEqual(svl.info(own)["usability"]["pairs"], 3)
        # The report has the distances of the rig.
        self.assertEqual(len(svl.score(own, {"mine": "bm"}).data["algorithms"]), 1)
        color = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
        for bgr, image in [(False, color), (True, color[..., ::-1])]:
            path = self.folder / f"{bgr}.mcap"
            moved = np.roll(image, -5, axis=1)
            (found,) = svl.read(svl.write(path, [(image, moved)], bgr=bgr, fps=30))
            grey = svl.match(color, np.roll(color, -5, axis=1), "bm").disparity
            np.testing.assert_array_equal(svl.match(found.left, found.right, "bm").disparity, grey)
        deep = (left.astype(np.uint16) << 2, right.astype(np.uint16) << 2)
        (found,) = svl.read(svl.write(self.folder / "deep.mcap", [deep], bits=10))
        np.testing.assert_array_equal(found.left, left)
        path = self.folder / "camera.yml"
        write_opencv_calibration(path)
        (found,) = svl.read(svl.write(self.folder / "raw.mcap", [(left, right)], calib=path))
        np.testing.assert_array_equal(found.left, svl.calibration(path).rectify(left, right)[0])

    def test_what_is_no_pair_is_refused(self):
        left, right = pair()
        for pairs, error, words in [
            ([], ValueError, ["no pairs"]),
            ([(left, right), (left, None)], TypeError, ["right of pair 1"]),
            ([(left, right[:-1])], ValueError, ["pair 0", r"\(96, 160\) and \(95, 160\)"]),
            ([(left,)], ValueError, ["expected"]),
            ([(left, right, 5), (left, right)], ValueError, ["1 of 2 pairs have a stamp"]),
            ([(left.astype(np.uint16), right)], ValueError, ["bits=N"]),
            ([(left[..., None].repeat(2, 2), right)], ValueError, ["no image"]),
        ]:
            with self.subTest(words=words), self.fails(error, *words):
                svl.write(self.folder / "own.mcap", pairs)
        self.assertEqual(os.listdir(self.folder), [])


class Program(InFolder):
    def test_algorithms_and_what_a_recording_has(self):
        known = {algorithm["name"]: algorithm for algorithm in svl.algorithms()}
        (found,) = [p for p in known["v5"]["parameters"] if p["name"] == "max_disparity"]
        self.assertEqual((found["default"], found["unit"]), (80, "px"))
        recording = svl.record("arena", self.folder / "a.mcap", frames=2)
        info = svl.info(recording)
        self.assertEqual((info["usability"]["pairs"], info["is_intact"]), (2, True))
        with self.fails(ValueError, "--no-such"):
            svl.info(recording, no_such=1)

    def test_a_score_needs_no_folder_and_names_algorithms(self):
        named = {"new": "v5:max_disparity=64", "old": "v5"}
        report = svl.score("arena", named, seeds="1", every=60)
        self.assertEqual({row["algorithm"] for row in report.data["algorithms"]}, {"new", "old"})
        folder = report.folder
        self.assertTrue((folder / "summary.json").is_file())
        self.assertIn("new", str(report))
        del report
        self.assertFalse(folder.exists())

    def test_record_score_report_and_compare(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=4, seed=2)
        self.assertTrue(recording.is_file())
        with self.fails(RuntimeError, "a.mcap: exists already"):
            svl.record("arena", recording, frames=4)
        with self.fails(ValueError, "--no-such"):
            svl.record("arena", self.folder / "b.mcap", no_such=1)
        with self.fails(FileNotFoundError, "-v"):
            svl.record("-v", self.folder / "b.mcap")
        with self.fails(ValueError, "help"):
            svl.record("arena", self.folder / "b.mcap", help=True)
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
        shutil.rmtree(self.folder / "s")
        with self.fails(FileNotFoundError, "no such folder"):
            other.tables()

    def test_the_gate_is_in_the_report(self):
        scenario = self.folder / "two.toml"
        for most, passes in [(0.99, True), (0.001, False)]:
            scenario.write_text(
                'name = "two"\n[source]\nkind = "arena"\n[arena]\nframes = 2\n'
                f'[[gate]]\nalgorithm = "v5"\nmetric = "unknown"\nmax = {most}\n'
            )
            report = svl.score(scenario, output=self.folder / f"r{most}", gate=True)
            self.assertIs(report.gate_passed, passes)

    def test_a_report_is_shown_by_its_page(self):
        report = svl.score("arena", "v5", output=self.folder / "r", seeds="1", every=60)
        shown = report._repr_html_()
        self.assertTrue(shown.startswith("<iframe srcdoc=") and shown.endswith("</iframe>"))
        page = (self.folder / "r/index.html").read_text(encoding="utf-8")
        self.assertLess(len(shown), 0.5 * len(page))
        for part in ["&lt;style&gt;", "&lt;table", "&lt;section id=&quot;timeline&quot;", "&lt;svg"]:
            self.assertIn(part, shown)
        for part in ["data:image", "&lt;details", "href=&quot;#", "<script", "<table"]:
            self.assertNotIn(part, shown)
        (self.folder / "r/index.html").unlink()
        self.assertIsNone(report._repr_html_())

    def test_tables_are_frames_of_what_is_there(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=3)
        report = svl.score(recording, ["v5", "bm"], output=self.folder / "r")
        shapes = {}
        for library, shape in [
            ("polars", lambda frame: frame.shape),
            ("pyarrow", lambda table: table.shape),
            ("pandas", lambda frame: frame.shape),
        ]:
            if importlib.util.find_spec(library):
                tables = report.tables(library)
                self.assertEqual(type(tables["rows"]).__module__.split(".")[0], library)
                shapes[library] = {name: shape(table) for name, table in tables.items()}
                self.assertEqual(shapes[library]["rows"][0], 6)
                self.assertEqual(shapes[library]["cells"][0], 90)
                first = next(iter(shapes))
                self.assertEqual(type(report.tables()["rows"]).__module__.split(".")[0], first)
                self.assertEqual(shapes[library], shapes[first])
            else:
                with self.fails(ImportError, f"pip install {library}"):
                    report.tables(library)
        with self.fails(ValueError, "frames='excel'", "polars, pyarrow, pandas"):
            report.tables("excel")
        none = (
            "import importlib.util; importlib.util.find_spec = lambda name: None\n"
            "import svl_bench as svl\n"
            f"try: svl.report({os.fspath(self.folder / 'r')!r}).tables()\n"
            "except ImportError as error: print(error)"
        )
        self.assertIn("polars or pyarrow or pandas: pip install polars", python(none))

    @has("pandas")
    def test_a_ranger_answers_what_the_bench_scores(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=3)
        report = svl.score(recording, "v5", output=self.folder / "r")
        cells = report.tables("pandas")["cells"]
        pairs = list(svl.read(recording))
        with svl.Ranger("v5", rig=pairs[0].rig) as ranger:
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


class Reading(InFolder):
    def assert_equal_pairs(self, some, others):
        self.assertEqual(len(some), len(others))
        for one, other in zip(some, others):
            self.assertEqual(one.stamp_ns, other.stamp_ns)
            np.testing.assert_array_equal(one.left, other.left)
            np.testing.assert_array_equal(one.right, other.right)

    def test_a_recording_and_a_bag_have_the_same_pairs(self):
        recording = svl.record("arena", self.folder / "a.mcap", frames=3)
        bag = svl.record(recording, self.folder / "bag.mcap", ros2=True)
        pairs = list(svl.read(recording))
        self.assertEqual([pair.sequence for pair in pairs], [0, 1, 2])
        self.assert_equal_pairs(pairs, list(svl.read(bag)))
        self.assert_equal_pairs(pairs, list(svl.read("arena", frames=3)))
        self.assert_equal_pairs(pairs[::2], list(svl.read(recording, every=2)))
        first = pairs[0]
        self.assertEqual(first.left.shape, (240, 320))
        self.assertEqual(first.left.dtype, np.uint8)
        self.assertAlmostEqual(first.rig.baseline_m, 0.044)
        depth = first.depth_m
        distance = first.rig.focal_px * 0.044 / first.true_disparity[120, 160]
        self.assertAlmostEqual(float(depth[120, 160]), float(distance), places=5)
        first.left[0, 0] = 1  # It is the caller's.

    @has("rosbags")
    def test_warnings_are_passed_on(self):
        bag = self.folder / "bag"
        write_raw_bag(bag, pair(), -0.1)
        messages = io.StringIO()
        with contextlib.redirect_stderr(messages):
            svl.record(bag, self.folder / "a.mcap")
        self.assertIn("raw images, rectified by its own calibration", messages.getvalue())

    @has("rosbags")
    def test_raw_bags_come_rectified(self):
        for distortion, is_changed in [(-0.1, True), (0.0, False)]:
            bag = self.folder / f"bag{distortion}"
            write_raw_bag(bag, pair(), distortion)
            (found,) = svl.read(bag)
            self.assertAlmostEqual(found.rig.baseline_m, 0.06)
            self.assertNotEqual(np.array_equal(found.left, pair()[0]), is_changed)
            # As `svl record` rectifies them, which `svl score` does alike.
            recording = svl.record(bag, self.folder / f"{distortion}.mcap")
            self.assert_equal_pairs([found], list(svl.read(recording)))
            (raw,) = svl.read(bag, calib="none")
            np.testing.assert_array_equal(raw.left, pair()[0])

    def test_a_reader_may_leave(self):
        began = time.monotonic()
        pairs = svl.read("arena", frames=100_000_000)
        next(pairs)
        pairs.close()
        self.assertLess(time.monotonic() - began, 20)

    def test_pairs_may_be_left_at_the_end(self):
        code = "import svl_bench as svl; pairs = svl.read('arena'); print(next(pairs).sequence)"
        self.assertEqual(python(code), "0\n")

    def test_an_interrupted_svl_is_an_error(self):
        pairs = svl.read("arena", frames=100_000)
        self.assertEqual(next(pairs).sequence, 0)
        (pid,) = svl_processes()
        os.kill(pid, signal.SIGTERM)
        with self.fails(RuntimeError, "interrupted after", "of 280 pairs"):
            for _ in pairs:
                pass

    def test_an_interrupt_of_python_ends_svl_orderly(self):
        path = self.folder / "a.mcap"

        def interrupt():
            while not path.exists() or path.stat().st_size < 1_000_000:
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGINT)

        thread = threading.Thread(target=interrupt)
        thread.start()
        with self.assertRaises(KeyboardInterrupt):
            svl.record("arena", path, frames=100_000)
        thread.join()
        self.assertEqual(svl_processes(), [])
        # It has its summary.
        self.assertIn('"damage": null', svl_program("info", path, "--json"))

    def test_errors_are_svl_s(self):
        for gone in ["none.bag", "none.mcap", "none"]:
            path = self.folder / gone
            for call in [
                lambda: next(svl.read(path)),
                lambda: svl.score(path),
                lambda: svl.record(path, self.folder / "b.mcap"),
                lambda: svl.info(path),
                lambda: svl.report(path),
                lambda: svl.calibration(path),
            ]:
                with self.subTest(gone=gone), self.fails(FileNotFoundError, gone):
                    call()
        with self.fails(FileNotFoundError, "nowhere"):
            svl.write(self.folder / "nowhere/own.mcap", [pair()])
        with self.fails(ValueError, "--no-such"):
            next(svl.read("arena", no_such=True))
        with self.fails(ValueError, "--ros2", "for files"):
            next(svl.read("arena", ros2=True))
        with self.fails(ValueError, "read"):
            svl.record("arena", "-")
        # Without the word that svl puts before it in a terminal.
        with self.fails(ValueError, "^unexpected argument"):
            svl.record("arena", self.folder / "b.mcap", frame=1)
        with self.fails(ValueError, "output", "record"):
            next(svl.read("arena", output="a.mcap"))
        with self.fails(ValueError, "algorithms is empty"):
            svl.score("arena", [], output=self.folder / "report")
        with self.fails(ValueError, "summary.json"):
            svl.report(__file__)
        with self.fails(OSError, "^none.safetensors: no such file"):
            svl.Ranger(filters="none.safetensors")
        recording = svl.record("arena", self.folder / "a.mcap", frames=8)
        cut = self.folder / "cut.mcap"
        cut.write_bytes(recording.read_bytes()[: recording.stat().st_size // 2])
        pairs = svl.read(cut)
        self.assertEqual(next(pairs).sequence, 0)
        with self.fails(RuntimeError, "cut.mcap"):
            list(pairs)

    def test_distances_of_disparities(self):
        rig = svl.Rig(100, 0.5, doffs_px=-2)
        found = rig.distance_m([[7, 2], [1, np.inf]])
        np.testing.assert_array_equal(found, np.float32([[10, np.inf], [np.nan, np.nan]]))
        self.assertEqual(found.dtype, np.float32)


class Package(InFolder):
    def test_a_matcher_loads_neither_the_extension_nor_the_program_s_modules(self):
        code = (
            "import sys; from svl_bench import matcher; matcher.serve; "
            "print([name for name in sys.modules if name.startswith('svl_bench')])"
        )
        self.assertEqual(ast.literal_eval(python(code)), ["svl_bench", "svl_bench.matcher"])

    def test_a_printed_module_is_found_without_the_package(self):
        printed = self.folder / "svl_bench"
        printed.mkdir()
        (printed / "matcher.py").write_text(svl_program("algos", "exec", "--example", "python"))
        # Without site-packages, but for numpy: the package may be beside it.
        packages = self.folder / "packages"
        packages.mkdir()
        for folder in Path(np.__file__).parents[1].glob("numpy*"):
            (packages / folder.name).symlink_to(folder)
        paths = [os.fspath(self.folder), os.fspath(packages)]
        code = f"import sys; sys.path += {paths!r}; from svl_bench import matcher; print(matcher.__file__)"
        line = [sys.executable, "-I", "-S", "-c", code]
        said = subprocess.run(line, capture_output=True, text=True, check=True).stdout
        self.assertEqual(said.strip(), os.fspath(printed / "matcher.py"))

    def test_without_numpy_there_is_one_line(self):
        there = os.fspath(Path(svl.__file__).parents[1])
        code = (
            f"import sys; sys.path.insert(0, {there!r}); sys.modules['numpy'] = None\n"
            "import svl_bench as svl\n"
            "for name in ['match', 'evaluate', 'write', 'calibration']:\n"
            "    try: getattr(svl, name)\n    except ImportError as error: print(error)\n"
        )
        line = [sys.executable, "-I", "-S", "-c", code]
        said = subprocess.run(line, capture_output=True, text=True, check=True).stdout.splitlines()
        self.assertEqual(len(said), 4)
        self.assertEqual(said[0], "svl_bench.match needs numpy: pip install numpy")

    def test_names_have_descriptions_and_types(self):
        for name in svl.__all__:
            if name not in ("REASONS", "__version__"):
                self.assertTrue(getattr(svl, name).__doc__, name)
        self.assertEqual(set(dir(svl)), set(svl.__all__))
        self.assertIn("height x width", pydoc.render_doc(svl.Ranger))
        self.assertTrue((Path(svl.__file__).parent / "py.typed").exists())
        with self.assertRaises(AttributeError):
            svl.no_such_name

    def test_a_wheel_of_another_machine(self):
        there = Path(svl.__file__).parent
        shutil.copytree(there, self.folder / "svl_bench", ignore=shutil.ignore_patterns("_svl.*so"))
        facts = self.folder / "svl_bench-0.1.0.dist-info"
        facts.mkdir()
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: svl-bench\nVersion: 0.1.0\n")
        (facts / "WHEEL").write_text("Wheel-Version: 1.0\nTag: cp39-abi3-manylinux_2_31_riscv64\n")
        code = (
            f"import sys; sys.path.insert(0, {os.fspath(self.folder)!r})\n"
            "import svl_bench as svl; svl.report\n"
            "try: svl.match\nexcept ImportError as error: print(error)"
        )
        said = python(code)
        for words in ["no extension for", "is for manylinux_2_31_riscv64", "on x86_64 and aarch64"]:
            self.assertIn(words, said)


def snippets(document):
    """The blocks of Python of a document."""
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


class StandInForTorch:
    """What a document uses of PyTorch, which tests do without: it notes the call of the export."""

    def __init__(self):
        self.nn = types.SimpleNamespace(Module=object)
        self.onnx = types.SimpleNamespace(export=self.export)

    def zeros(self, *shape):
        return np.zeros(shape)

    def export(self, network, images, file, *, input_names, output_names):
        self.exported = network.forward(*images)
        self.names = input_names, output_names


class Documents(InFolder):
    def run_snippets(self, document, **names):
        """The names of each snippet, run after those before it in the test's folder."""
        names = {"__name__": "snippet", **names}
        ran = []
        before = os.getcwd()
        os.chdir(self.folder)
        try:
            for code in snippets(document):
                if "svl." in code:
                    self.assertTrue(code.startswith("import svl_bench as svl\n"), code)
                exec(compile(code, document, "exec"), names)
                ran.append(dict(names))
        finally:
            os.chdir(before)
        return ran

    def test_every_snippet_is_run_by_a_test(self):
        documents = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
        having = {os.fspath(path.relative_to(ROOT)) for path in documents if snippets(path)}
        # The tutorial's is a file that its commands run: tests/bench/documents.rs.
        self.assertEqual(having, {"docs/library.md", "docs/networks.md", "docs/tutorials/network.md"})

    def test_the_library_s(self):
        bag = svl.record("arena", self.folder / "bag.mcap", frames=4)
        pairs = list(svl.read(bag))
        write_opencv_calibration(self.folder / "stereo.yaml")
        left, right = pair()
        camera = [(*pair(shift), shift * 100_000_000) for shift in (4, 8, 30)]
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            stop, arrays, rectified = self.run_snippets(
                "docs/library.md",
                camera=lambda: camera,
                lefts=[p.left for p in pairs],
                rights=[p.right for p in pairs],
                stamps_ns=[p.stamp_ns for p in pairs],
                left=left,
                right=right,
            )
        # Its square has 20 px: 328 px * 0.044 m / 20 px.
        self.assertEqual(said.getvalue().splitlines()[0], "nearest 0.73 m: go on")
        self.assertTrue(said.getvalue().splitlines()[2].endswith(": stop"))
        scores = arrays["scores"]
        found = svl.match(pairs[-1].left, pairs[-1].right, "v5", rig=pairs[-1].rig)
        np.testing.assert_array_equal(arrays["found"].disparity, found.disparity)
        self.assertLess(scores["bad2.0"], 20)
        self.assertLess(scores["abs_rel"], 0.2)
        self.assertGreater(scores["coverage"], 30)
        self.assertEqual(len(list(svl.read(self.folder / "own.mcap"))), 4)
        rows = arrays["report"].data["algorithms"]
        self.assertEqual({row["algorithm"] for row in rows}, {"new", "old"})
        self.assertAlmostEqual(rectified["found"].rig.baseline_m, 0.06, places=4)
        known = np.isfinite(rectified["found"].depth_m).sum()
        self.assertEqual(len(rectified["found"].points()), known)
        self.assertGreater(known, 0.3 * WIDTH * HEIGHT)

    def test_those_of_networks(self):
        torch = StandInForTorch()
        net = lambda left, right, iters, test_mode: (iters, left.shape, test_mode)
        net.eval = lambda: net
        *_, last = self.run_snippets("docs/networks.md", torch=torch, net=net)
        self.assertEqual(torch.exported, (1, 3, 480, 640))
        self.assertEqual(torch.names, (["left", "right"], ["disp"]))
        self.assertEqual(last["mine"](*pair()).mean(), 16)
        self.assertIsNone(last["mynet"](*pair()))


class Examples(InFolder):
    def test_a_robot_stops(self):
        line = [sys.executable, ROOT / "examples/python/stop.py"]
        said = subprocess.run(line, capture_output=True, text=True, check=True).stdout
        # Those of the other languages: tests/c.
        distances = ["1.43", "1.30", "1.10", "0.89", "0.68", "0.50"]
        actions = 5 * ["go on"] + ["stop"]
        expected = [f"nearest {m} m: {action}" for m, action in zip(distances, actions)]
        self.assertEqual(said.splitlines(), expected)

    @has("matplotlib")
    def test_the_notebook_from_top_to_bottom(self):
        """Its cells in a Python of their own; of each the last expression is shown."""
        notebook = json.loads((ROOT / "examples/python/report.ipynb").read_text(encoding="utf-8"))
        sources = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
        runner = (
            "import ast, json, sys\n"
            "names = {'__name__': '__main__'}\n"
            "for source in json.load(open('cells.json')):\n"
            "    *body, last = ast.parse(source).body\n"
            "    is_shown = isinstance(last, ast.Expr)\n"
            "    body += [] if is_shown else [last]\n"
            "    exec(compile(ast.Module(body, []), 'cell', 'exec'), names)\n"
            "    if is_shown:\n"
            "        shown = eval(compile(ast.Expression(last.value), 'cell', 'eval'), names)\n"
            "        print((getattr(shown, '_repr_html_', None) or shown.__repr__)())\n"
        )
        (self.folder / "cells.json").write_text(json.dumps(sources), encoding="utf-8")
        environment = {**os.environ, "MPLBACKEND": "Agg"}
        line = [sys.executable, "-c", runner]
        ran = subprocess.run(line, capture_output=True, text=True, cwd=self.folder, env=environment)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn("<iframe srcdoc=", ran.stdout)
        # Shares stand under the names of their metrics, counts under those of the columns.
        for total in svl.report(self.folder / "reports/run").data["algorithms"]:
            cells = sum(total[f"cells_{state}"] for state in ("right", "wrong", "unknown"))
            self.assertEqual(total["cases"]["right"], {"items": 60, "cells": cells})
            for state in ("right", "wrong", "unknown"):
                self.assertAlmostEqual(total[state], total[f"cells_{state}"] / cells)
            self.assertAlmostEqual(total["found"], total["found_obstacles"] / total["near"])
        for file in ["run.mcap", "reports/run/index.html", "cells.svg", "distances.svg"]:
            self.assertTrue((self.folder / file).is_file(), file)
        # The change is that of the program.
        compared = svl.compare(f"{self.folder}/reports/run#v3", f"{self.folder}/reports/run#v5")
        first = compared[0]["algorithms"][0]["metrics"][0]
        self.assertIn(f"{first['metric']:10} {first['difference']:+8.3f}", ran.stdout)


if __name__ == "__main__":
    unittest.main()
