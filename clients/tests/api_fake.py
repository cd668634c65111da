# SPDX-License-Identifier: Apache-2.0
"""Reflection and the HTTP front end of the service in memory, as far as the examples use them."""
import email.parser
import email.policy
import hashlib
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import grpc
from google.protobuf import descriptor_pool, json_format
from planning_fake import FINISHED, Refusal

from sightline.v1 import planning_service_pb2 as pb

CLIENTS = Path(__file__).resolve().parents[1]


def add_reflection(server):
    """grpc.reflection.v1alpha: every answer is one file, so that its imports are asked for."""
    loader = SourceFileLoader("grpc_call", str(CLIENTS / "shell" / "grpc_call"))
    caller = module_from_spec(spec_from_loader("grpc_call", loader))
    loader.exec_module(caller)
    messages = caller.protocol("reflection")
    pool = descriptor_pool.Default()

    def answer(requests, _):
        for request in requests:
            response = messages["Response"]()
            if request.list_services:
                response.services.service.add(name="sightline.v1.PlanningService")
            else:
                try:
                    file = (pool.FindFileByName(request.file_by_filename)
                            if request.file_by_filename else
                            pool.FindFileContainingSymbol(request.file_containing_symbol))
                    response.files.file_descriptor_proto.append(file.serialized_pb)
                except KeyError:
                    response.error.error_code = grpc.StatusCode.NOT_FOUND.value[0]
                    response.error.error_message = "Symbol not found."
            yield response

    handler = grpc.stream_stream_rpc_method_handler(
        answer, messages["Request"].FromString, messages["Response"].SerializeToString)
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(
        "grpc.reflection.v1alpha.ServerReflection", {"ServerReflectionInfo": handler}),))


class HttpApi(BaseHTTPRequestHandler):
    """POST /v1/jobs, GET of a job, of its events and results."""

    protocol_version = "HTTP/1.1"
    fake = None
    status_of = {"NOT_FOUND": 404, "ALREADY_EXISTS": 409, "INVALID_ARGUMENT": 400,
                 "FAILED_PRECONDITION": 409, "UNAVAILABLE": 503, "UNAUTHENTICATED": 401}

    def log_message(self, *_):
        pass

    def _answer(self, status, body, content_type="application/json"):
        self.send_response(status)
        self.send_header("Content-Type", content_type)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _answer_job(self, job, status=200):
        fields = json_format.MessageToDict(job, preserving_proto_field_name=True,
                                           including_default_value_fields=True)
        self._answer(status, json.dumps(fields, separators=(",", ":")).encode())

    def _call(self, method, answer):
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        try:
            if self.fake.token and self.headers["Authorization"] != f"Bearer {self.fake.token}":
                raise Refusal(grpc.StatusCode.UNAUTHENTICATED, "CREDENTIALS_UNKNOWN", "who?")
            self.fake.calls.append(method)
            self.fake._fault(method, after=False)
            answer(body)
        except Refusal as refusal:
            text = json.dumps({"error": {"code": refusal.code.name, "reason": refusal.reason,
                                         "message": refusal.message, "fields": []}})
            self._answer(self.status_of[refusal.code.name], text.encode())

    def do_POST(self):
        self._call("POST", self._create)

    def _create(self, body):
        head = f"Content-Type: {self.headers['Content-Type']}\r\n\r\n".encode()
        form = email.parser.BytesParser(policy=email.policy.HTTP).parsebytes(head + body)
        request = pb.CreatePlanningJobRequest(request_id=self.headers.get("Idempotency-Key", ""))
        for part in form.iter_parts():
            content = part.get_payload(decode=True)
            if part.get_param("name", header="content-disposition") == "task":
                json_format.Parse(content, request.task)
            else:
                digest = hashlib.sha256(content).hexdigest()
                self.fake.files[digest] = content
                request.files.add(name=part.get_filename(), digest=digest)
        self._answer_job(self.fake.create(request), 201)

    def do_GET(self):
        parts = self.path.strip("/").split("/")
        if parts[3:] == ["events"]:
            self._call("events", lambda _: self._events(parts[2]))
        elif parts[3:4] == ["results"]:
            self._call("results", lambda _: self._answer(
                200, self.fake.result(parts[2], "/".join(parts[4:]))[1],
                "application/octet-stream"))
        else:
            self._call("GET", lambda _: self._answer_job(self.fake._job(parts[2])))

    def _events(self, job_id):
        job = self.fake.wait_for_change(job_id, -1, 0)
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        self.wfile.write(b"id: 1\nevent: accepted\ndata: {}\n\n")
        while job.state not in FINISHED:
            job = self.fake.wait_for_change(job_id, job.revision, 60)
        self.wfile.write(b"id: 2\nevent: done\ndata: {}\n\n")


def serve_http(fake):
    """Starts the server; returns it with its URL."""
    handler = type("Api", (HttpApi,), {"fake": fake})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.handle_error = lambda *_: None  # Clients may hang up.
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server, f"http://127.0.0.1:{server.server_port}"
