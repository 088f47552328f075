"""The messages of Groot2's protocol, version 2, byte by byte; numbers are little-endian.

A request is a header and, for some, a second frame. The reply is the header again with the tree's id, and a second frame for some; or
`error` and a text.
"""

import struct
from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.monitoring.status_changes import IDLE

VERSION = 2
_HEADER = struct.Struct("<BBI")
_STATUS = struct.Struct("<HB")
_ERROR = b"error"
WAS = 10
"""A status in a snapshot from here on: IDLE, and before that it was so much less."""


class RequestKind(IntEnum):
    """What is asked for."""

    FULL_TREE = ord("T")
    STATUS = ord("S")
    BLACKBOARD = ord("B")
    HOOK_INSERT = ord("I")
    HOOK_REMOVE = ord("R")
    BREAKPOINT_REACHED = ord("N")
    BREAKPOINT_UNLOCK = ord("U")
    HOOKS_DUMP = ord("D")
    REMOVE_ALL_HOOKS = ord("A")
    DISABLE_ALL_HOOKS = ord("X")
    TOGGLE_RECORDING = ord("r")
    GET_TRANSITIONS = ord("t")


class RequestError(SarError):
    """A request that cannot be answered; its text is the reply."""


class Request(NamedTuple):
    """A request.

    Attributes:
        kind: What is asked for.
        number: The number that its sender has given it.
        rest: The frames after the header.
    """

    kind: RequestKind
    number: int
    rest: list[bytes]

    @property
    def payload(self) -> str:
        """The second frame.

        Raises:
            RequestError: If there is none, or it is no text.
        """
        if len(self.rest) != 1:
            message = "must be 2 parts message"
            raise RequestError(message)
        try:
            return self.rest[0].decode()
        except UnicodeDecodeError as error:
            message = f"the second part is no text in UTF-8: {error}"
            raise RequestError(message) from error


def read_request(frames: list[bytes]) -> Request:
    """Read a request.

    Raises:
        RequestError: If it is none.
    """
    if len(frames[0]) != _HEADER.size:
        message = "wrong request header"
        raise RequestError(message)
    _, kind, number = _HEADER.unpack(frames[0])
    try:
        return Request(RequestKind(kind), number, frames[1:])
    except ValueError:
        message = "Request not recognized"
        raise RequestError(message) from None


def header(kind: RequestKind, number: int) -> bytes:
    """Return the header of a request."""
    return _HEADER.pack(VERSION, kind, number)


def reply(request: Request, tree_id: bytes, payload: bytes | None) -> list[bytes]:
    """Return the frames of a reply.

    Args:
        request: What is answered.
        tree_id: The tree's id, 16 bytes.
        payload: The second frame; None for a reply that has none.
    """
    return [header(request.kind, request.number) + tree_id, *([] if payload is None else [payload])]


def error_reply(error: Exception) -> list[bytes]:
    """Return the frames that refuse a request."""
    return [_ERROR, str(error).encode("utf-8", "replace")]


def snapshot(statuses: Iterable[int]) -> bytes:
    """Return the statuses of nodes, those from the number 1 on."""
    return b"".join(_STATUS.pack(uid, status) for uid, status in enumerate(statuses, 1))


def shown_status(before: int, status: int) -> int:
    """Return how a status is shown in a snapshot."""
    return WAS + before if status == IDLE else status


def transition(microseconds: int, uid: int, status: int) -> bytes:
    """Return a change of a status in a recording.

    Args:
        microseconds: When it was, since the recording began.
        uid: The node's number.
        status: Its status.
    """
    return microseconds.to_bytes(6, "little") + _STATUS.pack(uid, status)
