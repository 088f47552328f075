"""Read the logs of BehaviorTree.CPP's `FileLogger2` (`.btlog`).

A log consists of `BTCPP4-FileLogger2`, one byte with the version 1, the length of the tree's XML (4 bytes), the XML, and the start time in
microseconds since 1970 (8 bytes). Each status change follows in 9 bytes: microseconds since the start (6), the node's number (2) and its status
(1). All numbers are little-endian. The log of a crashed program may end at any byte.
"""

import struct

from sar_compiler.importing.recording import SKIPPED, Recording, UnusableRecordingError

MAGIC = b"BTCPP4-FileLogger2"
_VERSION = 1
_LENGTH, _START = struct.Struct("<i"), struct.Struct("<q")
_CHANGE = struct.Struct("<IHHB")
# Maximum start time, in microseconds since 1970. A later time cannot be converted to a date.
_LATEST_USEC = 2**53


def read_btlog(data: bytes) -> Recording:
    """Read a log up to its last complete status change.

    Raises:
        UnusableRecordingError: If the version is not supported, or the log is damaged before the first status change.
    """
    at = len(MAGIC)
    if data[at : at + 1] != bytes([_VERSION]):
        raise UnusableRecordingError(
            f"the log's version in byte {at} is not supported. Only version {_VERSION} is supported"
        )
    at += 1
    if len(data) < at + _LENGTH.size:
        raise UnusableRecordingError(f"the log ends at byte {len(data)}, before the tree")
    (length,) = _LENGTH.unpack_from(data, at)
    at += _LENGTH.size
    if not 0 <= length <= len(data) - at - _START.size:
        raise UnusableRecordingError(
            f"the log ends at byte {len(data)}, within the tree, which starts at byte {at} and has {length} bytes"
        )
    try:
        tree = data[at : at + length].decode()
    except UnicodeDecodeError as error:
        raise UnusableRecordingError(f"byte {at + error.start} of the tree is not UTF-8") from error
    at += length
    (start,) = _START.unpack_from(data, at)
    if not 0 <= start < _LATEST_USEC:
        raise UnusableRecordingError(f"the start time at byte {at} is not a date")
    at += _START.size
    found = Recording("btlog", start / 1e6, tree)
    whole = (len(data) - at) // _CHANGE.size * _CHANGE.size
    if at + whole != len(data):
        found.flaws.append(f"the log ends at byte {len(data)}, within a status change")
    for index, (low, high, uid, status) in enumerate(_CHANGE.iter_unpack(memoryview(data)[at : at + whole])):
        if status > SKIPPED:
            found.flaws.append(
                f"byte {at + index * _CHANGE.size + _CHANGE.size - 1} is not a status: {status}. The rest was skipped"
            )
            break
        found.add(low | high << 32, uid, status)
    return found
