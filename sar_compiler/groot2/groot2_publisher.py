"""A server of Groot2's protocol, which lets Groot2 read a tree's nodes, statuses and blackboards over ZeroMQ.

This is version 2 of the protocol, with little-endian numbers. A request has a header (version, kind, a number chosen by the client) and, for
some kinds, a second frame. The reply has the same header with the tree's ID and, for some kinds, a second frame. The reply to an invalid
request has the frame `error` and a message.
"""

import struct
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from threading import Lock, Thread
from typing import Protocol

import msgpack
import zmq
from py_trees.visitors import VisitorBase

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.runtime.blackboard import MissingEntryError
from sar_compiler.views.numbered_tree import IDLE, NumberedTree, StatusChange, StatusChanges, tree_xml

DEFAULT_PORT = 1667
_LAST_PORT = 0xFFFF
_ADDRESS = "tcp://127.0.0.1"
# The maximum size of a request, in bytes.
_LARGEST = 1 << 20
# The maximum number of status changes in a recording; older changes are discarded.
_LONGEST_RECORDING = 1000
_VERSION = 2
_HEADER = struct.Struct("<BBI")
_STATUS = struct.Struct("<HB")
# A node that was reset to IDLE appears in a snapshot as this value plus its previous status.
_RESET = 10

_Responder = Callable[[Sequence[bytes]], bytes | None]
"""Returns the second frame of the reply, or None if the reply has only a header. The argument contains the request's frames without the
header."""


class Ticking(Protocol):
    """An engine that ticks a tree."""

    def add_visitor(self, visitor: VisitorBase) -> None:
        """Add a visitor that is called for every ticked node."""


class Groot2PortError(SarError):
    """Raised if the user has chosen a port for Groot2 that does not exist or cannot be used."""


class RequestError(SarError):
    """Raised if a request is invalid; the error's message is the reply."""


class Groot2Publisher:
    """Serves a tree to Groot2 and other clients of its protocol on this machine.

    It responds in its own thread. No request changes the tree: breakpoints and substituted outcomes are not supported.

    Args:
        tree: The compiled tree.
        port: The TCP port of 127.0.0.1 for requests; notifications use the next port.

    Raises:
        TooManyNodesError: If the tree has more nodes than the protocol can number.
        Groot2PortError: If a port does not exist or is in use.
    """

    def __init__(self, tree: CompiledTree, port: int = DEFAULT_PORT) -> None:
        self._tree = NumberedTree(tree)
        self._xml = tree_xml(self._tree).encode()
        self._id = uuid.uuid4().bytes
        self._changes = StatusChanges(self._tree, self._on_change)
        self._shown = [0] * len(self._tree.nodes)
        self._lock = Lock()
        self._transitions: deque[bytes] = deque(maxlen=_LONGEST_RECORDING)
        self._recording_began = 0
        self._is_recording = False
        # The responders by the kind of the request.
        self._responders: Mapping[bytes, _Responder] = {
            b"T": lambda _: self._xml,
            b"S": self._statuses,
            b"B": self._blackboards,
            b"r": self._toggle_recording,
            b"t": self._pop_transitions,
            # Groot2 requests the breakpoints when it connects, and removes them when it disconnects. This server has none.
            b"D": lambda _: b"[]",
            b"A": lambda _: None,
            b"X": lambda _: None,
            **dict.fromkeys((b"I", b"R", b"U"), _refuse_breakpoint),
        }
        self._context = zmq.Context()
        try:
            self._server = self._bind(zmq.REP, port)
            # Groot2 subscribes to notifications about reached breakpoints; none are sent.
            self._publisher = self._bind(zmq.PUB, port + 1)
        except BaseException:
            self._context.destroy(linger=0)
            raise
        self._thread: Thread | None = Thread(target=self._serve, name="groot2", daemon=True)
        self._thread.start()

    def _bind(self, kind: int, port: int) -> "zmq.Socket[bytes]":
        if not 0 < port <= _LAST_PORT:
            message = f"there is no port {port}. Choose a port from 1 to {_LAST_PORT - 1}. Groot2 also needs the port after the chosen one"
            raise Groot2PortError(message)
        socket: zmq.Socket[bytes] = self._context.socket(kind)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST)
        try:
            socket.bind(f"{_ADDRESS}:{port}")
        except zmq.ZMQError as error:
            message = f"port {port} of 127.0.0.1 cannot be used: {error.strerror}. Choose another port"
            raise Groot2PortError(message) from error
        return socket

    def observe(self, ticking: Ticking) -> None:
        """Observe the engine that ticks the tree: a `TreeRunner`, or py_trees' `BehaviourTree`."""
        ticking.add_visitor(self._changes)

    def close(self) -> None:
        """Stop responding to requests; further calls have no effect."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._publisher.close()
        # This interrupts the other thread's wait for a request, and waits until that thread has closed its socket.
        self._context.term()
        thread.join()

    def _on_change(self, change: StatusChange) -> None:
        with self._lock:
            self._shown[change.uid - 1] = _RESET + change.before if change.status == IDLE else change.status
            if self._is_recording:
                microseconds = (time.monotonic_ns() - self._recording_began) // 1000
                moment = microseconds.to_bytes(6, "little")
                self._transitions.append(moment + _STATUS.pack(change.uid, change.status))

    def _serve(self) -> None:
        with self._server, suppress(zmq.ContextTerminated):
            while True:
                self._server.send_multipart(self._reply(self._server.recv_multipart()))

    def _reply(self, frames: list[bytes]) -> list[bytes]:
        try:
            return self._respond(*frames)
        except Exception as error:  # noqa: BLE001 - an invalid request must not end the mission
            return [b"error", str(error).encode("utf-8", "replace")]

    def _respond(self, header: bytes, *rest: bytes) -> list[bytes]:
        if len(header) != _HEADER.size:
            raise RequestError("the header of this request has a wrong length")
        responder = self._responders.get(header[1:2])
        if responder is None:
            raise RequestError("this kind of request is unknown")
        second = responder(rest)
        return [bytes([_VERSION]) + header[1:] + self._id, *([] if second is None else [second])]

    def _statuses(self, _: Sequence[bytes]) -> bytes:
        with self._lock:  # held only for the copy, because ticks wait for the lock
            shown = [*self._shown]
        return snapshot(shown)

    def _blackboards(self, rest: Sequence[bytes]) -> bytes:
        found: dict[str, object] = {}
        for name in filter(None, _text(rest).split(";")):
            path = "" if name == self._tree.name else name
            if path in self._tree.scopes:
                found[name] = self._entries(path)
                if path:
                    found["ROOT"] = self._entries("")
        packed: bytes = msgpack.packb(found or None)
        return packed

    def _entries(self, path: str) -> dict[str, object]:
        found = {}
        for key, entry in self._tree.scopes[path].entries():
            with suppress(MissingEntryError):  # never written, or removed by a concurrent tick
                found[key] = _copy_value(entry.read())
        return found

    def _toggle_recording(self, rest: Sequence[bytes]) -> bytes | None:
        word = _text(rest)
        with self._lock:
            if word == "start":
                self._recording_began = time.monotonic_ns()
                self._transitions.clear()
            self._is_recording = word == "start" or (self._is_recording and word != "stop")
        return b"%d" % (time.time_ns() // 1000) if word == "start" else None

    def _pop_transitions(self, _: Sequence[bytes]) -> bytes:
        with self._lock:
            transitions = b"".join(self._transitions)
            self._transitions.clear()
        return transitions


def _refuse_breakpoint(_: Sequence[bytes]) -> bytes | None:
    raise RequestError(
        "breakpoints and substituted outcomes are not supported in Groot2. Set breakpoints on the web page of sar-run --view web"
    )


def _text(rest: Sequence[bytes]) -> str:
    """Return the text in the second frame of a request.

    Raises:
        RequestError: If the request does not have exactly two frames, or the text is not valid UTF-8.
    """
    if len(rest) != 1:
        raise RequestError("this request must have exactly 2 parts")
    try:
        return rest[0].decode()
    except UnicodeDecodeError as error:
        raise RequestError(f"the second part of the request is not valid UTF-8: {error}") from error


def snapshot(statuses: Iterable[int]) -> bytes:
    """Encode the statuses of a tree's nodes, ordered by node number, as the reply to a status request."""
    return b"".join(_STATUS.pack(uid, status) for uid, status in enumerate(statuses, 1))


def _copy_value(value: object) -> object:
    """Copy a blackboard value to a value that msgpack can encode, because a later tick may change the original.

    An unsupported value becomes None. BehaviorTree.CPP does the same for types without a converter.
    """
    try:
        copy: object = msgpack.unpackb(msgpack.packb(value), use_list=False, strict_map_key=False)
    except (TypeError, ValueError, OverflowError, RuntimeError):  # RuntimeError: the dictionary has grown
        return None
    return copy
