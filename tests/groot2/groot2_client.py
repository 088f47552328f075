"""A client of Groot2's protocol, written from its description and not from the code under test."""

import struct

import msgpack
import zmq
from zmq.utils.monitor import recv_monitor_message

from tests.waiting import News

PATIENCE_MSEC = 20_000


class Client:
    """Sends requests to a publisher, and receives its notifications."""

    def __init__(self, port):
        self._context, self._port = zmq.Context(), port
        self._asking = self._socket(zmq.REQ, port)
        self._hearing = self._socket(zmq.SUB, port + 1)
        self._hearing.setsockopt(zmq.SUBSCRIBE, b"")
        # Notifications before the subscription are lost; any reply shows that the publisher knows the
        # subscriber.
        self.statuses()

    def _socket(self, kind, port):
        made = self._context.socket(kind)
        made.setsockopt(zmq.RCVTIMEO, PATIENCE_MSEC)
        happens = made.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
        made.connect(f"tcp://127.0.0.1:{port}")
        recv_monitor_message(happens)
        made.disable_monitor()
        return made

    def close(self):
        self._context.destroy(linger=0)

    def send(self, *frames):
        """Send frames unchanged; return the frames of the reply."""
        self._asking.send_multipart(list(frames))
        return self._asking.recv_multipart()

    def ask(self, kind, *payload):
        """Send a request; return the frames after the reply's header."""
        request = struct.pack("<BBI", 2, ord(kind), 0xDEADBEEF)
        head, *rest = self.send(request, *payload)
        assert len(head) == 22, (head, rest)
        assert head[:6] == request
        return rest

    def refused(self, *frames):
        """Send frames unchanged, which must be rejected; return the error text."""
        word, text = self.send(*frames)
        assert word == b"error"
        return text.decode()

    def is_disconnected_by(self, *frames):
        """Send frames unchanged on a separate connection, and wait until the publisher closes it."""
        socket = self._context.socket(zmq.REQ)
        happens = socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        happens.setsockopt(zmq.RCVTIMEO, PATIENCE_MSEC)
        socket.connect(f"tcp://127.0.0.1:{self._port}")
        socket.send_multipart(list(frames))
        recv_monitor_message(happens)
        socket.close(linger=0)

    def statuses(self):
        """Return the bytes of all statuses, by number."""
        (packed,) = self.ask("S")
        assert len(packed) % 3 == 0
        return dict(struct.iter_unpack("<HB", packed))

    def see(self, wanted):
        """Poll until the statuses are as wanted; those of one tick are published one after the other."""
        news = News()
        with news:
            news.wait_until(lambda: self.statuses() == wanted, lambda: f"never {wanted}: {self.statuses()}")

    def blackboards(self, names):
        """Return the contents of blackboards."""
        (packed,) = self.ask("B", names.encode())
        return msgpack.unpackb(packed)

    def transitions(self):
        """Return the transitions of a recording: microseconds, number and status."""
        (packed,) = self.ask("t")
        return [
            (int.from_bytes(packed[at : at + 6], "little"), *struct.unpack("<HB", packed[at + 6 : at + 9]))
            for at in range(0, len(packed), 9)
        ]

    def hears(self):
        """Return whether the publisher has sent a notification."""
        return self._hearing.poll(0) != 0

    def heard(self):
        """Return the type and the text of the publisher's next notification."""
        head, text = self._hearing.recv_multipart()
        protocol, kind, _ = struct.unpack("<BBI", head)
        assert protocol == 2
        return chr(kind), text.decode()


def request(kind, number=1):
    """Return the header of a request."""
    return struct.pack("<BBI", 2, ord(kind), number)
