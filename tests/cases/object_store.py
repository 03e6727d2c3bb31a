"""A small object store that speaks as much of S3 as this program uses, in a thread of the test.

Requests: GET, HEAD, PUT (also only where nothing is, only onto a known object, and in parts), DELETE, LIST
of version 2. Answers are those of the reference: https://docs.aws.amazon.com/AmazonS3/latest/API/Welcome.html
"""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape, unescape

#: What no message may contain.
KEY, SECRET = "AKIAIOSFODNN7EXAMPLE", "wJalrXUtnFEMI-K7MDENG-bPxRfiCYEXAMPLEKEY"
BUCKET = "bucket"
_PART = "?part"


@dataclass
class ObjectStoreTwin:
    """What is in the store, and what becomes of requests."""

    objects: dict[str, bytes] = field(default_factory=dict)
    written: dict[str, datetime] = field(default_factory=dict)
    requests: list[tuple[str, str]] = field(default_factory=list)
    #: Says which status a request is refused with, if any, by its method and name.
    refuse: Callable[[str, str], int | None] = lambda method, name: None
    url: str = ""

    def environment(self) -> dict[str, str]:
        """Where the store is, and who asks."""
        return {
            "AWS_ENDPOINT_URL": self.url,
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
        }

    def put(self, name: str, content: bytes) -> None:
        self.objects[name], self.written[name] = content, datetime.now(UTC).replace(microsecond=0)

    def age(self, name: str, seconds: float) -> None:
        """Let an object have been written earlier."""
        self.written[name] -= timedelta(seconds=seconds)


@contextmanager
def running() -> Iterator[ObjectStoreTwin]:
    """A store at an address of this computer."""
    store = ObjectStoreTwin()
    server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(store))
    server.daemon_threads = True
    store.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield store
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _xml(kind: str, **fields: str) -> bytes:
    inside = "".join(f"<{name}>{escape(value)}</{name}>" for name, value in fields.items())
    return f"<{kind}>{inside}</{kind}>".encode()


def _tag(content: bytes) -> str:
    return f'"{hashlib.md5(content, usedforsecurity=False).hexdigest()}"'


def _handler(store: ObjectStoreTwin) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        # An answer in one packet: the other side waits 40 ms for a second one.
        wbufsize = 1 << 20
        disable_nagle_algorithm = True

        def log_message(self, *of_the_request: object) -> None:
            pass

        def _begin(self) -> tuple[str, bytes] | None:
            """Name and content of a request; None for one that was refused."""
            name = unquote(urlsplit(self.path).path).removeprefix(f"/{BUCKET}").lstrip("/")
            content = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            store.requests.append((self.command, name))
            status = store.refuse(self.command, name)
            if status is not None:
                # As S3 does, which quotes the key.
                told = f"<Error><Code>Refused</Code><AWSAccessKeyId>{KEY}</AWSAccessKeyId></Error>"
                self._answer(status, told.encode())
                return None
            return name, content

        def _answer(self, status: int, content: bytes = b"", name: str | None = None) -> None:
            self.send_response(status)
            self.send_header("Content-Length", str(len(content)))
            if name is not None:
                self.send_header("ETag", _tag(store.objects[name]))
                self.send_header("Last-Modified", format_datetime(store.written[name], usegmt=True))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(content)

        def do_GET(self) -> None:
            begun = self._begin()
            if begun is None:
                return
            query = parse_qs(urlsplit(self.path).query)
            if "list-type" in query:
                self._answer(200, _listing(store, query.get("prefix", [""])[0]))
            elif begun[0] in store.objects:
                self._answer(200, store.objects[begun[0]], begun[0])
            else:
                self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")

        do_HEAD = do_GET

        def do_PUT(self) -> None:
            begun = self._begin()
            if begun is None:
                return
            (name, content), query = begun, parse_qs(urlsplit(self.path).query)
            if "partNumber" in query:
                name = f"{name}{_PART}{int(query['partNumber'][0]):04d}"
            if self.headers.get("If-None-Match") == "*" and name in store.objects:
                self._answer(412, b"<Error><Code>PreconditionFailed</Code></Error>")
                return
            wanted = self.headers.get("If-Match")
            if wanted is not None and wanted != _tag(store.objects.get(name, b"")):
                self._answer(412, b"<Error><Code>PreconditionFailed</Code></Error>")
                return
            store.put(name, content)
            self._answer(200, b"", name)

        def do_DELETE(self) -> None:
            begun = self._begin()
            if begun is not None:
                store.objects.pop(begun[0], None)
                self._answer(204)

        def do_POST(self) -> None:
            """Many deleted at once, or the beginning and the end of an object in parts."""
            begun = self._begin()
            if begun is None:
                return
            (name, content), query = begun, parse_qs(urlsplit(self.path).query, keep_blank_values=True)
            if "delete" in query:
                keys = re.findall(r"<Key>(.*?)</Key>", content.decode())
                for key in keys:
                    store.objects.pop(unescape(key), None)
                told = "".join(f"<Deleted><Key>{key}</Key></Deleted>" for key in keys)
                self._answer(200, f"<DeleteResult>{told}</DeleteResult>".encode())
            elif "uploads" in query:
                self._answer(200, _xml("InitiateMultipartUploadResult", UploadId="1"))
            else:
                parts = sorted(key for key in store.objects if key.startswith(f"{name}{_PART}"))
                store.put(name, b"".join(store.objects.pop(key) for key in parts))
                self._answer(200, _xml("CompleteMultipartUploadResult", ETag=_tag(store.objects[name])), name)

    return Handler


def _listing(store: ObjectStoreTwin, prefix: str) -> bytes:
    found = "".join(
        f"<Contents><Key>{escape(name)}</Key><Size>{len(content)}</Size><ETag>{escape(_tag(content))}</ETag>"
        f"<LastModified>{store.written[name].strftime('%Y-%m-%dT%H:%M:%S.000Z')}</LastModified>"
        "<StorageClass>STANDARD</StorageClass></Contents>"
        for name, content in sorted(store.objects.items())
        if name.startswith(prefix)
    )
    return f"<ListBucketResult><IsTruncated>false</IsTruncated>{found}</ListBucketResult>".encode()
