# SPDX-License-Identifier: Apache-2.0
"""The examples as a user runs them: processes against the service in memory and a real broker.

SIGHTLINE_NODE_MODULES: folder with the installed packages of clients/node.
"""
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import unittest

import grpc
from api_fake import add_reflection, serve_http
from planning_fake import PlanningFake, Refusal, away, serve
from sightline.v1 import planning_service_pb2 as pb

CLIENTS = pathlib.Path(__file__).resolve().parents[1]
HEAD = CLIENTS.parent / "examples" / "cylinder_head"


class ExampleTests:
    """What all examples that plan must do; test cases say how one is started."""

    def setUp(self):
        self.fake = PlanningFake()
        self.server, port = serve(self.fake, "127.0.0.1:0", [add_reflection])
        self.addCleanup(lambda: self.server.stop(0).wait())
        self.address = f"127.0.0.1:{port}"
        self.http_server, self.url = serve_http(self.fake)
        self.addCleanup(self.http_server.server_close)
        self.addCleanup(self.http_server.shutdown)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def command(self):
        raise NotImplementedError

    def start(self, request_id="order-17", **environment):
        return subprocess.run([*self.command(), str(self.folder / "plan"), request_id],
                              env={**os.environ, **environment}, text=True, timeout=120,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def check_files(self, run):
        self.assertEqual(0, run.returncode, run.stdout)
        for name in ("report.html", "plan.json"):
            self.assertEqual(self.fake.results[name], (self.folder / "plan" / name).read_bytes())
        self.assertEqual(["plan.json", "report.html"], sorted(os.listdir(self.folder / "plan")))

    def test_saves_the_plan(self):
        self.check_files(self.start())
        (request,) = self.fake.tasks.values()
        self.assertEqual("order-17", request.request_id)
        self.assertEqual("plan", request.task.kind)
        self.assertEqual("cylinder head", request.task.inspection.name)
        self.assertEqual([("cylinder_head.glb", (HEAD / "cylinder_head.glb").read_bytes())],
                         [(f.name, self.fake.files[f.digest]) for f in request.files])

    def test_the_same_request_is_the_same_job(self):
        self.check_files(self.start())
        self.check_files(self.start())
        self.assertEqual(["job-1"], list(self.fake.jobs))

    def test_a_failed_job_is_an_error(self):
        self.fake.finish_jobs = False
        create = self.fake.create

        def create_and_fail(request):
            job = create(request)
            self.fake.update(job.job_id, state=pb.PlanningJob.FAILED, failure=pb.JobFailure(
                code="RESOURCE_EXHAUSTED", reason="OUT_OF_MEMORY", message="needs 80 GB"))
            return job

        self.fake.create = create_and_fail
        run = self.start()
        self.assertEqual(1, run.returncode, run.stdout)
        self.assertIn("OUT_OF_MEMORY", run.stdout)
        self.assertIn("needs 80 GB", run.stdout)

    def test_a_refusal_is_shown(self):
        def refuse(_):
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, "INVALID_FIELD", "goal: is 7")

        self.fake.create = refuse
        run = self.start()
        self.assertEqual(1, run.returncode, run.stdout)
        self.assertIn("goal: is 7", run.stdout)

    def test_tokens(self):
        self.fake.token = "secret"
        run = self.start()
        self.assertEqual(1, run.returncode, run.stdout)
        self.check_files(self.start(SIGHTLINE_TOKEN="secret"))


class NodeTest(ExampleTests, unittest.TestCase):
    def command(self):
        # Node looks for packages beside the script.
        folder = self.folder / "node"
        if not folder.exists():
            (folder / "clients" / "node").mkdir(parents=True)
            shutil.copy(CLIENTS / "node" / "plan_cylinder_head.js", folder / "clients" / "node")
            shutil.copy(CLIENTS / "node" / "package.json", folder / "clients" / "node")
            for name in ("proto", "examples"):
                (folder / name).symlink_to(CLIENTS.parent / name)
            (folder / "clients" / "node" / "node_modules").symlink_to(
                os.environ["SIGHTLINE_NODE_MODULES"])
        return ["node", str(folder / "clients" / "node" / "plan_cylinder_head.js"), self.address]

    def test_goes_on_after_a_restart(self):
        for method in ("UploadFile", "CreatePlanningJob", "WatchPlanningJob", "StreamResult"):
            self.fake.fail_next(method, away())
        self.fake.fail_next("CreatePlanningJob", away(), after=True)
        self.fake.fail_next("StreamResult", away(), chunks=2)
        self.check_files(self.start())
        self.assertEqual(["job-1"], list(self.fake.jobs))


class HttpTest(ExampleTests, unittest.TestCase):
    def command(self):
        return [str(CLIENTS / "http" / "plan.sh"), self.url]

    def test_goes_on_after_a_restart(self):
        for method in ("POST", "GET", "events", "results"):
            self.fake.fail_next(method, away())
        self.check_files(self.start())
        self.assertEqual(["job-1"], list(self.fake.jobs))


class ShellTest(ExampleTests, unittest.TestCase):
    def command(self):
        return [str(CLIENTS / "shell" / "plan.sh"), self.address]

    def test_watches_anew(self):
        self.fake.fail_next("WatchPlanningJob", away())
        self.check_files(self.start())

    def grpc_call(self, *arguments):
        return subprocess.run([sys.executable, str(CLIENTS / "shell" / "grpc_call"), "-plaintext",
                               *arguments], text=True, timeout=60, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT)

    def test_lists_describes_and_explains(self):
        self.assertEqual("sightline.v1.PlanningService\n",
                         self.grpc_call(self.address, "list").stdout)
        self.assertIn("UploadFile", self.grpc_call(self.address, "describe",
                                                   "sightline.v1.PlanningService").stdout)
        unknown = self.grpc_call("-d", '{"job_id": "gone"}', self.address,
                                 "sightline.v1.PlanningService/GetPlanningJob")
        self.assertEqual((1, "NOT_FOUND: no job gone\nreason: JOB_UNKNOWN\n"),
                         (unknown.returncode, unknown.stdout))
        for wrong in ('{"job_ix": ""}', "{"):
            run = self.grpc_call("-d", wrong, self.address,
                                 "sightline.v1.PlanningService/GetPlanningJob")
            self.assertEqual(1, run.returncode)
            self.assertTrue(run.stdout.startswith("-d: "), run.stdout)


class MqttTest(unittest.TestCase):
    """Against mosquitto."""

    def test_prints_events_also_those_that_came_while_it_did_not_run(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = str(free.getsockname()[1])
        broker = subprocess.Popen(["mosquitto", "-p", port], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True)
        self.addCleanup(broker.stdout.close)
        self.addCleanup(broker.wait)
        self.addCleanup(broker.terminate)
        # "mosquitto version ... running"; another line before it speaks of running, too.
        self.assertTrue(any(line.endswith(" running\n") for line in broker.stdout))
        event = json.dumps({"event_id": "7", "type": "done", "job": {"job_id": "job-1"}})

        def publish(topic, message):
            subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", port, "-q", "1", "-t", topic,
                            "-m", message], check=True, timeout=30)

        def listen():
            process = subprocess.Popen(
                [str(CLIENTS / "mqtt" / "listen.sh"), "done"], stdout=subprocess.PIPE, text=True,
                env={**os.environ, "SIGHTLINE_MQTT_HOST": "127.0.0.1",
                     "SIGHTLINE_MQTT_PORT": port})
            self.addCleanup(process.stdout.close)
            return process

        # The retained status says that it has subscribed.
        subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", port, "-r", "-t",
                        "sightline/status", "-m", "online"], check=True, timeout=30)
        listener = listen()
        self.assertEqual("sightline/status online\n", listener.stdout.readline())
        publish("sightline/jobs/job-1/progress", "not asked for")
        publish("sightline/jobs/job-1/done", event)
        self.assertEqual(f"sightline/jobs/job-1/done {event}\n", listener.stdout.readline())
        listener.terminate()
        listener.wait()

        publish("sightline/jobs/job-2/done", event)
        listener = listen()
        lines = {listener.stdout.readline(), listener.stdout.readline()}
        listener.terminate()
        listener.wait()
        self.assertIn(f"sightline/jobs/job-2/done {event}\n", lines)


if __name__ == "__main__":
    unittest.main()
