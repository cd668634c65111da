# SPDX-License-Identifier: Apache-2.0
"""A channel to the service, and calls that are tried again while it restarts."""
from __future__ import annotations

import os
import pathlib
import random
import threading
import time
from typing import Any, Callable, List, Optional, Tuple, TypeVar, Union

import grpc

from . import errors

Pem = Union[str, "os.PathLike[str]", bytes]
Result = TypeVar("Result")

MAX_MESSAGE_BYTES = 64 << 20
_FIRST_DELAY_S = 0.1
_MAX_DELAY_S = 5.0


class Backoff:
    """Delays that grow while a service stays away, and none longer than until `end`."""

    def __init__(self, retry_for_s: float) -> None:
        self._retry_for_s = retry_for_s
        self.reset()

    def reset(self) -> None:
        self._delay_s = _FIRST_DELAY_S
        self._end = time.monotonic() + self._retry_for_s

    def wait(self, asked_s: Optional[float]) -> bool:
        """Waits, `asked_s` at least if the service says so; False: the time is over."""
        # Clients that lost the same server must not come back at the same moment.
        delay_s = max(asked_s or 0.0, self._delay_s * random.uniform(0.5, 1.0))
        if time.monotonic() + delay_s > self._end:
            return False
        time.sleep(delay_s)
        self._delay_s = min(2 * self._delay_s, _MAX_DELAY_S)
        return True


def _pem(value: Optional[Pem]) -> Optional[bytes]:
    if value is None or isinstance(value, bytes):
        return value
    return pathlib.Path(value).read_bytes()


def _is_local(address: str) -> bool:
    if address.startswith(("unix:", "unix-abstract:")):
        return True
    host = address.rpartition(":")[0].rpartition("/")[2].strip("[]")
    return host in ("localhost", "::1") or host.startswith("127.")


class Connection:
    """Thread-safe."""

    def __init__(self, address: str, token: Optional[str], root_certificates: Union[Pem, bool, None],
                 certificate: Optional[Pem], key: Optional[Pem], timeout_s: float,
                 retry_for_s: float, allow_plaintext: bool) -> None:
        if (certificate is None) != (key is None):
            raise ValueError("certificate and key: give both or none")
        tls = bool(root_certificates) or certificate is not None
        if token and not tls and not _is_local(address) and not allow_plaintext:
            raise ValueError(f"{address}: the token would cross the network unencrypted; give "
                             "root_certificates, or allow_plaintext=True")
        self.timeout_s = timeout_s
        self.retry_for_s = retry_for_s
        self._metadata: List[Tuple[str, str]] = (
            [("authorization", f"Bearer {token}")] if token else [])
        options = [("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
                   ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
                   # Calls are tried again here, with a deadline over all tries.
                   ("grpc.enable_retries", 0),
                   # A service that restarted is found quickly.
                   ("grpc.initial_reconnect_backoff_ms", 100),
                   ("grpc.max_reconnect_backoff_ms", 2000)]
        if tls:
            roots = None if root_certificates is True else _pem(root_certificates or None)
            credentials = grpc.ssl_channel_credentials(roots, _pem(key), _pem(certificate))
            self.channel = grpc.secure_channel(address, credentials, options)
        else:
            self.channel = grpc.insecure_channel(address, options)
        self._closed = threading.Event()

    def close(self) -> None:
        self._closed.set()
        self.channel.close()

    def call(self, method: Callable[..., Result], make_request: Callable[[], Any],
             timeout_s: Optional[float] = None) -> Result:
        """Calls until it works or fails by another code than UNAVAILABLE.

        Only for calls that do no harm twice. `make_request` makes the request, or a new iterator
        of a stream's messages, for every try. `timeout_s` is the deadline of one try.
        """
        backoff = Backoff(self.retry_for_s)
        while True:
            try:
                return method(make_request(), timeout=timeout_s or self.timeout_s,
                              metadata=self._metadata)
            except grpc.RpcError as rpc_error:
                error = errors.from_rpc_error(rpc_error)
                if not self.waits_after(error, backoff):
                    raise error from None

    def stream(self, method: Callable[..., Any], request: Any, timeout_s: float) -> Any:
        """The answers of one try; the caller catches grpc.RpcError."""
        return method(request, timeout=timeout_s, metadata=self._metadata)

    def waits_after(self, error: errors.ServiceError, backoff: Backoff) -> bool:
        """Whether the call may be tried again; has waited then."""
        return (isinstance(error, errors.Unavailable) and not self._closed.is_set()
                and backoff.wait(error.retry_delay_s))
