# SPDX-License-Identifier: Apache-2.0
"""The Python client against a service in memory; with SIGHTLINE_ADDRESS against a real one too."""
import hashlib
import importlib
import io
import json
import os
import pathlib
import struct
import subprocess
import tempfile
import threading
import unittest
import zlib
from concurrent import futures

import grpc
import numpy as np
import sightline
from PIL import Image
from planning_fake import PlanningFake, Refusal, away, serve
from sightline.task_files import file_references, parse_message
from sightline.v1 import inspection_pb2
from sightline.v1 import planning_service_pb2 as pb
from sightline.v1 import planning_service_pb2_grpc as pb_grpc

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = REPOSITORY / "examples"
HEAD = EXAMPLES / "cylinder_head" / "inspection.json"
TRIANGLE = sightline.Mesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]])


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def plan_end_to_end(test, client, folder, **options):
    """Plans the cylinder head and looks at everything that comes back; any service must pass."""
    seen = []
    job = client.plan(HEAD, **options).wait(on_progress=seen.append)
    test.assertEqual("SUCCEEDED", job.state)
    test.assertEqual("SUCCEEDED", seen[-1].state)
    test.assertEqual(sorted(s.revision for s in seen), [s.revision for s in seen])
    test.assertIn(job.job_id, [j.job_id for j in client.jobs(kinds=["plan"])])
    test.assertEqual(job.results, client.job(job.job_id).results)

    names = [r.name for r in job.results]
    test.assertIn("report.html", names)
    paths = job.download(folder)
    test.assertEqual(names, [p.relative_to(folder).as_posix() for p in paths])
    for result, path in zip(job.results, paths):
        test.assertEqual(result.digest, sha256(path.read_bytes()), result.name)

    plan = job.plan()
    test.assertGreaterEqual(len(plan.scans), 1)
    test.assertEqual([s.index for s in plan.scans], list(range(1, len(plan.scans) + 1)))
    test.assertAlmostEqual(plan.coverage.covered_targets / plan.coverage.measurable_targets,
                           plan.coverage.coverage)
    for scan in plan.scans:
        np.testing.assert_allclose(scan.camera_pose[3], [0, 0, 0, 1])
    points, normals = plan.points(), plan.normals()
    test.assertEqual((sum(s.measurement_points for s in plan.scans), 3), points.shape)
    test.assertEqual(points.shape, normals.shape)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    np.testing.assert_array_equal(plan.points(1), points[:len(plan.points(1))])
    test.assertIn(f"{len(plan.scans)} scans", plan._repr_html_())
    return job


class ClientTest(unittest.TestCase):
    def setUp(self):
        self.fake = PlanningFake()
        self.server, port = serve(self.fake, "127.0.0.1:0")
        self.addCleanup(lambda: self.server.stop(0).wait())
        self.address = f"127.0.0.1:{port}"
        self.client = sightline.Client(self.address)
        self.addCleanup(self.client.close)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def task(self, job):
        return self.fake.tasks[job.job_id]

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    # --- tasks and files

    def test_plans_the_cylinder_head(self):
        job = plan_end_to_end(self, self.client, self.folder / "plan")
        request = self.task(job)
        self.assertEqual("cylinder_head.glb", request.task.inspection.part.file)
        self.assertEqual(["cylinder_head.glb"], [f.name for f in request.files])
        plan = job.plan()
        self.assertEqual("GOAL_REACHED", plan.stop_reason)
        self.assertEqual(-20, plan.scans[0].measurement.triangulation_angle_deg)
        self.assertEqual(2, plan.scans[1].camera_pose[0, 3])
        self.assertEqual([0.0, 0.05, 0.1], list(plan.scans[0].trigger_positions_m))
        with self.assertRaises(IndexError):
            plan.point_cloud(3)

    def test_uploads_only_what_the_service_does_not_have(self):
        self.client.plan(HEAD)
        self.client.plan(HEAD)
        part = (HEAD.parent / "cylinder_head.glb").read_bytes()
        self.assertEqual([sha256(part)], self.fake.uploads)
        self.assertEqual(part, self.fake.files[sha256(part)])
        self.assertEqual(3, self.fake.calls.count("CreatePlanningJob"))

    def test_finds_files_outside_of_the_inspections_folder(self):
        job = self.client.render(EXAMPLES / "cylinder_head_image" / "inspection.json", frame=3)
        request = self.task(job)
        names = {f.name: f.digest for f in request.files}
        self.assertEqual(5, len(names))
        for reference in file_references(request.task):
            self.assertEqual(sha256((EXAMPLES / reference.value).read_bytes()),
                             names[reference.value])
        self.assertEqual(3, request.task.render_options.frames.frame)

    def test_finds_files_that_material_files_name(self):
        self.write("parts/a.ply", "ply")
        self.write("materials/steel.json", '{"conductor": {"refractive_index_file": "../nk.csv"},'
                                           ' "height_field": {"file": "fields/h.txt"}}')
        self.write("nk.csv", "wavelength_nm,n,k")
        self.write("materials/fields/h.txt", "0 1")
        path = self.write("station/inspection.json", json.dumps({
            "part": {"file": "../parts/a.ply", "unit": "m"},
            "materials": [{"file": "../materials/steel.json"}]}))
        request = self.task(self.client.plan(path))
        self.assertEqual(
            ["materials/fields/h.txt", "materials/steel.json", "nk.csv", "parts/a.ply"],
            [f.name for f in request.files])

    def test_every_field_that_names_a_file_is_found(self):
        inspection = inspection_pb2.Inspection()
        inspection.part.file = "p"
        inspection.camera.sensor_file = "c"
        inspection.tolerances.file = "t"
        inspection.obstacles.add(file="o")
        inspection.materials.add(file="m")
        inspection.materials.add().material.merl.file = "b"
        self.assertEqual({"part.file": "p", "camera.sensor_file": "c", "tolerances.file": "t",
                          "obstacles[0].file": "o", "materials[0].file": "m",
                          "materials[1].material.merl.file": "b"},
                         {r.path: r.value for r in file_references(inspection)})

    def test_a_dict_with_files_in_memory(self):
        job = self.client.plan({"part": {"file": "sub/a.ply", "unit": "m"}},
                               files={"sub/a.ply": b"ply"}, goal=0.9, no_pictures=True, seed=7,
                               priority=-3)
        request = self.task(job)
        self.assertEqual(["sub/a.ply"], [f.name for f in request.files])
        self.assertEqual((0.9, True, 7, -3),
                         (request.task.plan_options.goal, request.task.plan_options.no_pictures,
                          request.task.seed, request.priority))

    def test_a_message_beside_a_folder(self):
        self.write("a.ply", "ply")
        message = inspection_pb2.Inspection()
        message.part.file = "a.ply"
        job = self.client.plan(message, folder=self.folder)
        self.assertEqual([(sha256(b"ply"), 3)],
                         [(f.digest, f.size_bytes) for f in self.task(job).files])
        self.assertEqual("a.ply", message.part.file)

    def test_arrays_as_a_part(self):
        task = self.task(self.client.plan({"name": "triangle"}, part=TRIANGLE))
        self.assertEqual(("part.ply", "m"),
                         (task.task.inspection.part.file, task.task.inspection.part.unit))
        data = self.fake.files[task.files[0].digest]
        header, _, body = data.partition(b"end_header\n")
        self.assertIn(b"element vertex 3", header)
        np.testing.assert_array_equal(
            np.frombuffer(body, "<f4", 9).reshape(3, 3), np.float32(TRIANGLE.vertices_m))
        self.assertEqual(b"\x03" + np.array([0, 1, 2], "<i4").tobytes(), body[36:])

    def test_wrong_arrays_are_refused(self):
        for vertices, triangles in (([[0, 0]], [[0, 0, 0]]), ([[0, 0, 0]], [[0, 0, 1]]),
                                    ([[0, 0, 0]], [[0.5, 0, 0]]), ([[0, 0, np.inf]], [[0, 0, 0]]),
                                    ([], [])):
            with self.assertRaises(sightline.TaskError):
                sightline.Mesh(vertices, triangles).to_ply()

    def test_big_files_go_in_chunks(self):
        # The service refuses chunks above 1 MiB.
        data = bytes(range(256)) * (5 << 10) + b"x"
        self.assertEqual(sha256(data), self.client.upload(data))
        self.assertEqual(data, self.fake.files[sha256(data)])

    def test_plans_of_other_tasks(self):
        job = self.client.plan(HEAD).wait()
        by_job = self.task(self.client.evaluate(HEAD, job)).task
        self.assertEqual((job.job_id, False), (by_job.plan_job_id, by_job.HasField("plan")))
        by_value = self.task(self.client.optics(HEAD, job.plan(), scan=2)).task
        self.assertEqual(2, len(by_value.plan.scans))
        self.assertEqual(2, by_value.optics_options.scan)
        self.assertFalse(by_value.other_part)
        self.assertTrue(self.task(self.client.evaluate(HEAD, job, other_part=True)).task.other_part)
        self.assertTrue(self.task(self.client.optics(HEAD, job, other_part=True)).task.other_part)
        self.assertTrue(self.task(self.client.render(HEAD, job, other_part=True)).task.other_part)
        path = job.download(self.folder)[[r.name for r in job.results].index("plan.json")]
        self.assertEqual(by_value.plan, self.task(self.client.evaluate(HEAD, path)).task.plan)

    def test_measured_points_are_judged(self):
        plan = {"scans": [{}, {}]}
        scans = [self.write("real/scan_01.ply", "ply"), self.write("real/scan_02.tif", "tif")]
        self.write("real/scan_02.json", "{}")
        request = self.task(self.client.inspect(HEAD, plan, scans, measured_unit="mm",
                                                tolerated_distance_m=0.003))
        options = request.task.inspect_options
        self.assertEqual(("inspect", "mm", 0.003), (
            request.task.kind, options.measured_unit, options.tolerated_distance_m))
        self.assertEqual(["measured/scan_01.ply", "measured/scan_02.tif"],
                         [scan.file for scan in options.measured])
        names = [f.name for f in request.files]
        self.assertIn("measured/scan_02.json", names)
        self.assertIn("measured/scan_01.ply", names)
        self.assertEqual(2, len(request.task.plan.scans))
        with self.assertRaisesRegex(sightline.TaskError, "a list of files"):
            self.client.inspect(HEAD, plan, scans[0])
        with self.assertRaisesRegex(sightline.TaskError, "gone.ply: cannot be read"):
            self.client.inspect(HEAD, plan, ["gone.ply"])

    def test_acceptance_tests_are_asked_for(self):
        request = self.task(self.client.accept(HEAD, no_images=True, seed=3))
        self.assertEqual(("accept", True, 3), (
            request.task.kind, request.task.accept_options.no_images, request.task.seed))

    def test_recordings_and_their_images(self):
        self.write("set/images/000.png", "png")
        self.write("set/recordings.json", json.dumps({
            "format_version": 2, "recordings": [{"file": "images/000.png"}],
            "part": {"file": "elsewhere.glb"}}))
        part = self.write("parts/p.stl", "stl")
        verified = self.task(self.client.verify(self.folder / "set"))
        self.assertEqual(["images/000.png"], [f.name for f in verified.files])
        request = self.task(self.client.diagnose(self.folder / "set", part=part, part_unit="mm",
                                                 excluded_effects=["smear"], max_effects=2))
        self.assertEqual(["images/000.png", "part/p.stl"], [f.name for f in request.files])
        options = request.task.diagnose_options
        self.assertEqual(("part/p.stl", "mm", ["smear"], 2),
                         (options.part_file, options.part_unit, list(options.excluded_effects),
                          options.max_effects))

    def test_a_shot_list_needs_no_images(self):
        job = self.client.render(recordings={"recordings": [{"file": "images/000.png"}]})
        self.assertEqual(0, len(self.task(job).files))

    def test_wrong_tasks_name_what_is_wrong(self):
        material = self.write("m.json", '{"merl": {"file": "gone.binary"}}')
        cases = [
            ("goall", lambda: self.client.plan({"goall": {}})),
            ("part.file: no file .*gone.glb",
             lambda: self.client.plan({"part": {"file": "gone.glb"}})),
            ("gone.json: cannot be read", lambda: self.client.plan("gone.json")),
            ("did you mean 'max_scans'", lambda: self.client.plan(HEAD, max_scan=3)),
            ("option 'goal'", lambda: self.client.plan(HEAD, goal="high")),
            ("no file .*gone.binary", lambda: self.client.plan(
                {"materials": [{"file": str(material)}]})),
            ("give it by `files`", lambda: self.client.plan(
                {"materials": [{"file": "m.json"}]}, files={"m.json": material.read_bytes()})),
            ("must be a path below", lambda: self.client.plan({}, files={"../a": b""})),
            ("must be a path, a dict", lambda: self.client.plan(3)),
            ("inspection or recordings", lambda: self.client.render()),
        ]
        for pattern, call in cases:
            with self.subTest(pattern), self.assertRaisesRegex(sightline.TaskError, pattern):
                call()
        self.assertEqual([], self.fake.calls)

    # --- errors and retries

    def test_errors_have_code_reason_and_fields(self):
        with self.assertRaises(sightline.InvalidArgument) as caught:
            self.client.plan(HEAD, goal=2)
        error = caught.exception
        self.assertEqual(("INVALID_ARGUMENT", "INVALID_FIELD"), (error.code, error.reason))
        self.assertEqual([sightline.FieldViolation("plan_options.goal",
                                                   "is 2.0, must be in (0, 1]")], error.violations)
        self.assertIn("plan_options.goal", str(error))
        with self.assertRaises(sightline.NotFound) as caught:
            self.client.job("gone")
        self.assertEqual("JOB_UNKNOWN", caught.exception.reason)

    def test_a_lost_answer_makes_no_second_job(self):
        self.fake.fail_next("CreatePlanningJob", away(), after=True)
        self.client.upload(HEAD.parent / "cylinder_head.glb")
        job = self.client.plan(HEAD)
        self.assertEqual(2, self.fake.calls.count("CreatePlanningJob"))
        self.assertEqual([job.job_id], list(self.fake.jobs))

    def test_the_same_request_id_is_the_same_job(self):
        first = self.client.plan(HEAD, request_id="order-17")
        self.assertEqual(first.job_id, self.client.plan(HEAD, request_id="order-17").job_id)
        with self.assertRaises(sightline.AlreadyExists) as caught:
            self.client.plan(HEAD, request_id="order-17", goal=0.5)
        self.assertEqual("REQUEST_ID_REUSED", caught.exception.reason)

    def test_an_upload_is_tried_again_from_its_beginning(self):
        self.fake.fail_next("UploadFile", away())
        data = b"z" * (3 << 20)
        self.client.upload(data)
        self.assertEqual(data, self.fake.files[sha256(data)])

    def test_other_errors_are_not_tried_again(self):
        full = Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "DISK_FULL", "the disk is full")
        self.fake.fail_next("UploadFile", full)
        with self.assertRaises(sightline.ResourceExhausted) as caught:
            self.client.plan(HEAD)
        self.assertEqual("DISK_FULL", caught.exception.reason)
        self.assertEqual(1, self.fake.calls.count("UploadFile"))

    def test_unavailable_is_said_in_the_end(self):
        self.server.stop(0).wait()
        with sightline.Client(self.address, retry_for_s=0.3) as client:
            with self.assertRaises(sightline.Unavailable):
                client.job("job-1")

    def test_a_deadline_ends_a_call(self):
        self.fake.held["GetPlanningJob"] = threading.Event()
        self.addCleanup(self.fake.held["GetPlanningJob"].set)
        with sightline.Client(self.address, timeout_s=0.2) as client:
            with self.assertRaises(sightline.DeadlineExceeded) as caught:
                client.job("job-1")
        self.assertIsInstance(caught.exception, TimeoutError)

    def test_tokens(self):
        self.fake.token = "secret"
        with self.assertRaises(sightline.Unauthenticated) as caught:
            self.client.plan(HEAD)
        self.assertEqual("CREDENTIALS_UNKNOWN", caught.exception.reason)
        with sightline.Client(self.address, token="secret") as client:
            self.assertEqual("SUCCEEDED", client.plan(HEAD).wait().state)
        with self.assertRaisesRegex(ValueError, "unencrypted"):
            sightline.Client("planner.factory:7080", token="secret")
        with self.assertRaisesRegex(ValueError, "both"):
            sightline.Client(self.address, certificate=b"pem")

    def test_tls_with_certificates_on_both_sides(self):
        pem = {}
        for name in ("server", "client"):
            subprocess.run(
                ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj",
                 f"/CN={name}", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout",
                 self.folder / f"{name}.key", "-out", self.folder / f"{name}.pem"],
                check=True, stderr=subprocess.DEVNULL)
            pem[name] = [(self.folder / f"{name}.{end}").read_bytes() for end in ("key", "pem")]
        server = grpc.server(futures.ThreadPoolExecutor(2))
        pb_grpc.add_PlanningServiceServicer_to_server(self.fake, server)
        port = server.add_secure_port("127.0.0.1:0", grpc.ssl_server_credentials(
            [tuple(pem["server"])], pem["client"][1], require_client_auth=True))
        server.start()
        self.addCleanup(lambda: server.stop(0).wait())
        address, roots = f"localhost:{port}", self.folder / "server.pem"
        with sightline.Client(address, root_certificates=roots,
                              certificate=self.folder / "client.pem",
                              key=self.folder / "client.key") as client:
            self.assertEqual("SUCCEEDED", client.plan(HEAD).wait().state)
        for wrong in ({"root_certificates": roots}, {}):
            with sightline.Client(address, retry_for_s=0.3, **wrong) as client:
                with self.assertRaises(sightline.Unavailable):
                    client.job("job-1")

    # --- waiting

    def test_every_change_is_seen_through_restarts(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        self.fake.fail_next("WatchPlanningJob", away(), chunks=2)
        states = []
        for status in job.watch():
            states.append((status.state, status.progress))
            if len(states) == 1:
                self.fake.update(job.job_id, state=pb.PlanningJob.RUNNING, progress=0.5)
            elif len(states) == 2:
                # The watch broke just now; this change comes by the next one.
                self.fake.update(job.job_id, state=pb.PlanningJob.SUCCEEDED)
        self.assertEqual([("QUEUED", 0), ("RUNNING", 0.5), ("SUCCEEDED", 1)], states)
        self.assertEqual("SUCCEEDED", job.state)

    def test_a_watch_waits_for_a_service_that_restarts(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        watch = job.watch()
        self.assertEqual("QUEUED", next(watch).state)
        self.server.stop(0).wait()
        self.fake.update(job.job_id, state=pb.PlanningJob.SUCCEEDED)
        self.server, _ = serve(self.fake, self.address)
        self.assertEqual(["SUCCEEDED"], [s.state for s in watch])

    def test_waiting_ends_with_a_failure(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        self.fake.update(job.job_id, state=pb.PlanningJob.FAILED, failure=pb.JobFailure(
            code="RESOURCE_EXHAUSTED", reason="OUT_OF_MEMORY", message="too much <memory>"))
        with self.assertRaises(sightline.JobFailed) as caught:
            job.wait()
        self.assertEqual(("RESOURCE_EXHAUSTED", "OUT_OF_MEMORY", job),
                         (caught.exception.code, caught.exception.reason, caught.exception.job))
        self.assertIn("too much &lt;memory&gt;", job._repr_html_())

    def test_cancelling(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        self.assertEqual("CANCELLED", job.cancel().state)
        with self.assertRaises(sightline.JobCancelled):
            job.wait()

    def test_waiting_has_an_end(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        with self.assertRaises(sightline.WaitTimeout):
            job.wait(timeout_s=0.2)
        self.assertEqual("QUEUED", self.client.job(job.job_id).state)

    def test_lists_all_pages(self):
        made = [self.client.plan(HEAD).job_id for _ in range(5)]
        self.assertEqual(made[::-1], [j.job_id for j in self.client.jobs()])
        self.assertEqual([], list(self.client.jobs(states=["QUEUED"])))

    # --- results

    def test_a_broken_stream_goes_on_where_it_broke(self):
        job = self.client.plan(HEAD).wait()
        for chunks in (1, 2):
            self.fake.fail_next("StreamResult", away(), chunks=chunks)
        self.assertEqual(self.fake.results["report.html"], job.read("report.html"))

    def test_other_bytes_than_promised_are_an_error(self):
        job = self.client.plan(HEAD).wait()
        self.fake.results["report.html"] = b"x" * len(self.fake.results["report.html"])
        with self.assertRaises(sightline.IncompleteResult):
            job.download(self.folder)
        self.assertFalse((self.folder / "report.html").exists())
        self.assertEqual([], list(self.folder.rglob("*.part")))

    def test_results_before_the_end_and_unknown_ones(self):
        self.fake.finish_jobs = False
        job = self.client.plan(HEAD)
        for call in (lambda: job.read("plan.json"), lambda: job.download(self.folder)):
            with self.assertRaises(sightline.FailedPrecondition) as caught:
                call()
            self.assertEqual("JOB_NOT_FINISHED", caught.exception.reason)
        self.fake.update(job.job_id, state=pb.PlanningJob.SUCCEEDED)
        with self.assertRaises(sightline.NotFound) as caught:
            job.read("gone.json")
        self.assertEqual("RESULT_UNKNOWN", caught.exception.reason)

    def test_results_stay_below_the_folder(self):
        self.fake.results = {"../evil.txt": b"x"}
        with self.assertRaises(sightline.IncompleteResult):
            self.client.plan(HEAD).wait().download(self.folder / "inner")
        self.assertFalse((self.folder / "evil.txt").exists())

    def test_what_is_there_already_is_not_fetched_again(self):
        job = self.client.plan(HEAD).wait()
        job.download(self.folder)
        calls = self.fake.calls.count("StreamResult")
        (self.folder / "report.html").write_bytes(b"broken")
        job.download(self.folder)
        self.assertEqual(calls + 1, self.fake.calls.count("StreamResult"))
        self.assertEqual(self.fake.results["report.html"],
                         (self.folder / "report.html").read_bytes())

    def test_images_are_arrays_of_16_bits(self):
        pixels = np.array([[0, 1, 256], [4095, 40000, 65535]], np.uint16)
        for name, kind in (("images/000.png", "PNG"), ("images/001.tif", "TIFF")):
            out = io.BytesIO()
            Image.fromarray(pixels).save(out, kind)
            self.fake.results[name] = out.getvalue()
        job = self.client.plan(HEAD).wait()
        self.assertEqual(["images/000.png", "images/001.tif"], job.image_names)
        for name in job.image_names:
            image = job.image(name)
            self.assertEqual(np.uint16, image.pixels.dtype)
            np.testing.assert_array_equal(pixels, image.pixels)
            shown = np.asarray(Image.open(io.BytesIO(image._repr_png_())))
            self.assertEqual((0, 255), (shown[0, 0], shown[1, 2]))

    def test_colour_images_keep_their_16_bits(self):
        pixels = np.array([[[0, 1, 256], [4095, 40000, 65535]]], np.uint16)

        def chunk(kind, data):
            return (struct.pack(">I", len(data)) + kind + data
                    + struct.pack(">I", zlib.crc32(kind + data)))

        self.fake.results["images/000_rgb.png"] = (
            b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 1, 16, 2, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(b"\0" + pixels.astype(">u2").tobytes()))
            + chunk(b"IEND", b""))
        job = self.client.plan(HEAD).wait()
        try:
            importlib.import_module("cv2")
        except ImportError:
            # Fewer bits than were recorded would be worse than none.
            with self.assertRaisesRegex(ImportError, "python3-opencv"):
                job.image("images/000_rgb.png")
        else:
            np.testing.assert_array_equal(pixels, job.image("images/000_rgb.png").pixels)

    def test_points_that_are_no_ply(self):
        for data in (b"", b"plyx", self.fake.results["points/scan_01.ply"][:-1]):
            self.fake.results["points/scan_01.ply"] = data
            plan = self.client.plan(HEAD).wait().plan()
            with self.assertRaises(sightline.IncompleteResult):
                plan.points()


class CommentTest(unittest.TestCase):
    def test_inspections_may_have_comments(self):
        text = '// one\n{"name": "a // b \\" // c", // d\n "part": {"file": "p.stl"} } //'
        message = parse_message(text, inspection_pb2.Inspection(), "inspection.json")
        self.assertEqual(message.name, 'a // b " // c')
        self.assertEqual(message.part.file, "p.stl")


@unittest.skipUnless("SIGHTLINE_ADDRESS" in os.environ, "SIGHTLINE_ADDRESS is not set")
class RealServiceTest(unittest.TestCase):
    """SIGHTLINE_TOKEN, and the PEM file SIGHTLINE_ROOT_CERTIFICATES, if the service needs them."""

    def test_plans_the_cylinder_head(self):
        with sightline.Client(os.environ["SIGHTLINE_ADDRESS"], os.environ.get("SIGHTLINE_TOKEN"),
                              os.environ.get("SIGHTLINE_ROOT_CERTIFICATES")) as client, \
                tempfile.TemporaryDirectory() as folder:
            job = plan_end_to_end(self, client, pathlib.Path(folder) / "plan", max_scans=2,
                                  evaluations_per_scan=200, bound_evaluations=0, no_pictures=True)
            self.assertLessEqual(len(job.plan().scans), 2)
            with self.assertRaises(sightline.InvalidArgument) as caught:
                client.plan(HEAD, goal=2)
            self.assertTrue(caught.exception.violations)


if __name__ == "__main__":
    unittest.main()
