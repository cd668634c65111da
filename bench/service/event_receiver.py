# SPDX-License-Identifier: Apache-2.0
"""A receiver of webhooks that does what docs/clients.md says: it checks the signature, keeps the
largest event_id and leaves out every event whose id is not greater. It knows more than a real one:
which events it left out, so that a left-out event that it never took is counted as missed."""

import hashlib
import hmac
import http.server
import json
import random
import threading


class EventReceiver:
    def __init__(self, secret: bytes, seed: int, fault_rate: float = 0.02):
        self.secret, self.fault_rate = secret, fault_rate
        self.generator = random.Random(seed)
        self.lock = threading.Lock()
        self.largest = 0
        self.taken: dict[int, tuple] = {}  # event_id to (type, job_id, state)
        self.repeated = 0  # deliveries of an event that was taken before
        self.missed: list[tuple] = []  # left out, and never taken
        self.unsigned = 0
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                status = outer.deliver(self.headers.get("X-Sightline-Signature", ""), body)
                if status == 0:  # taken, and the answer gets lost
                    self.close_connection = True
                    return
                self.send_response(status)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.server_address[1]}/events"

    def deliver(self, signature: str, body: bytes) -> int:
        """HTTP status of the answer; 0 for none."""
        right = "sha256=" + hmac.new(self.secret, body, hashlib.sha256).hexdigest()
        with self.lock:
            if not hmac.compare_digest(signature, right):
                self.unsigned += 1
                return 401
            if self.generator.random() < self.fault_rate:
                return 503
            event = json.loads(body)
            self.take(int(event["event_id"]),
                      (event["type"], event["job"]["job_id"], event["job"]["state"]))
            return 0 if self.generator.random() < self.fault_rate else 200

    def take(self, event_id: int, event: tuple) -> None:
        if event_id > self.largest:
            self.largest = event_id
            self.taken[event_id] = event
        elif self.taken.get(event_id) == event:
            self.repeated += 1
        else:
            self.missed.append((event_id, *event))

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()
