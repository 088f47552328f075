"""A client of Groot2's protocol, which BehaviorTree.CPP's `Groot2Publisher` serves. It only reads: it sets no breakpoints and does not change the tree.

This is version 2 of the protocol, with little-endian numbers. A request has a header (version, kind, a number chosen by the client) and, for some kinds, a
second frame. The reply has the same header with the tree's ID and, for some kinds, a second frame. An error reply has the frame `error` and a message.
"""

import random
import struct
from typing import NamedTuple

import zmq

from sar_compiler.importing.recording import IDLE, RUNNING, SKIPPED, UnusableRecordingError

_VERSION = 2
_HEADER, _CHANGE, _STATUS = struct.Struct("<BBI"), struct.Struct("<IHHB"), struct.Struct("<HB")
_ID_BYTES = 16
_PATIENCE_MSEC = 2000
_LARGEST = 64 * 2**20
MOST_WAITING = 1000
"""The maximum number of changes that a publisher stores between two requests; older changes are lost."""


class RecordedChange(NamedTuple):
    """A change of a node's status.

    Attributes:
        time: The time since the start of the recording, in microseconds.
        uid: The number of the node.
        status: The status after the change.
    """

    time: int
    uid: int
    status: int


class NoResponseError(UnusableRecordingError):
    """Raised if no program responds at the address."""


class Groot2Client:
    """A client of a program that serves Groot2's protocol.

    Args:
        address: The program's host and port, `HOST:PORT`.

    Raises:
        UnusableRecordingError: If the address is invalid.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._id = b""
        self._context = zmq.Context()
        self._socket: zmq.Socket[bytes] = self._context.socket(zmq.REQ)
        for option, value in (
            (zmq.LINGER, 0),
            (zmq.RCVTIMEO, _PATIENCE_MSEC),
            (zmq.SNDTIMEO, _PATIENCE_MSEC),
            (zmq.MAXMSGSIZE, _LARGEST),
        ):
            self._socket.setsockopt(option, value)
        try:
            self._socket.connect(f"tcp://{address}")
        except zmq.ZMQError as error:
            self.close()
            raise UnusableRecordingError(f"{address} is not HOST:PORT: {error.strerror}") from error

    def close(self) -> None:
        """Disconnect from the program."""
        self._context.destroy(linger=0)

    def read_tree(self) -> str:
        """Request the tree in XML, which includes the numbers of the nodes.

        Raises:
            UnusableRecordingError: If no program responds, or the response is not a tree.
        """
        try:
            return self._request(b"T").decode()
        except UnicodeDecodeError as error:
            raise UnusableRecordingError(f"the tree at {self._address} is not UTF-8") from error

    def start_recording(self) -> float:
        """Start recording status changes; return the start time, in seconds since 1970.

        Raises:
            UnusableRecordingError: If no program responds, or the response is not a time.
        """
        text = self._request(b"r", b"start")
        if not text.isdigit() or len(text) > len(str(2**53)):
            raise UnusableRecordingError(f"{self._address} cannot record: it responds with {text[:40]!r}")
        return int(text) / 1e6

    def stop_recording(self) -> None:
        """Stop recording status changes.

        Raises:
            UnusableRecordingError: If no program responds.
        """
        self._request(b"r", b"stop")

    def read_statuses(self) -> list[tuple[int, int]]:
        """Request the number and status of each node that is not IDLE.

        Raises:
            UnusableRecordingError: If no program responds, or the response is not a list of statuses.
        """
        data = self._unpack_exactly(self._request(b"S"), _STATUS.size)
        return [(uid, status) for uid, status in _STATUS.iter_unpack(data) if RUNNING <= status <= SKIPPED]

    def read_changes(self) -> list[RecordedChange]:
        """Request the status changes since the last call, at most `MOST_WAITING`.

        Raises:
            UnusableRecordingError: If no program responds, or the response is not a list of changes.
        """
        data = self._unpack_exactly(self._request(b"t"), _CHANGE.size)
        return [
            RecordedChange(low | high << 32, uid, status)
            for low, high, uid, status in _CHANGE.iter_unpack(data)
            if IDLE <= status <= SKIPPED
        ]

    def _unpack_exactly(self, data: bytes, size: int) -> bytes:
        if len(data) % size:
            raise UnusableRecordingError(
                f"the response from {self._address} has {len(data)} bytes, but the length must be a multiple of {size}"
            )
        return data

    def _request(self, kind: bytes, *payload: bytes) -> bytes:
        header = _HEADER.pack(_VERSION, kind[0], random.getrandbits(32))
        try:
            self._socket.send_multipart([header, *payload])
            reply, *rest = self._socket.recv_multipart()
        except zmq.ZMQError as error:
            raise NoResponseError(
                f"no program responds at {self._address}. Start a program with BehaviorTree.CPP's Groot2Publisher, and pass its first port"
            ) from error
        if reply == b"error":
            text = b"".join(rest).decode("utf-8", "replace")
            raise UnusableRecordingError(
                f"{self._address} refuses a request of Groot2's protocol: {text:.200}"
            )
        if len(reply) != _HEADER.size + _ID_BYTES or reply[1 : _HEADER.size] != header[1:] or len(rest) > 1:
            raise UnusableRecordingError(
                f"{self._address} does not use Groot2's protocol, version {_VERSION}"
            )
        if self._id not in (b"", reply[_HEADER.size :]):
            raise UnusableRecordingError(
                f"the program at {self._address} has been restarted or has loaded another tree"
            )
        self._id = reply[_HEADER.size :]
        return b"".join(rest)
