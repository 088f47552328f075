"""Read the logs of BehaviorTree.CPP's `FileLogger2` (`.btlog`).

The format: `BTCPP4-FileLogger2`, a byte with the version 1, the length of the tree's XML (4 bytes), the XML, the start in microseconds since
1970 (8 bytes), and for each change 9 bytes: microseconds since the start (6), the node's number (2), its status (1). All numbers are
little-endian. The log of a crashed program may end anywhere.
"""

import struct

from sar_compiler.importing.recording import SKIPPED, Recording, UnusableRecordingError

MAGIC = b"BTCPP4-FileLogger2"
_VERSION = 1
_LENGTH, _START = struct.Struct("<i"), struct.Struct("<q")
_CHANGE = struct.Struct("<IHHB")
# A later time is no date that a computer can print.
_LATEST_USEC = 2**53


def read_btlog(data: bytes) -> Recording:
    """Read a log up to its last complete change.

    Raises:
        UnusableRecordingError: If no part of it can be used.
    """
    at = len(MAGIC)
    if data[at : at + 1] != bytes([_VERSION]):
        raise UnusableRecordingError(f"byte {at} is not the version {_VERSION}, the only supported one")
    at += 1
    if len(data) < at + _LENGTH.size:
        raise UnusableRecordingError(f"it ends at byte {len(data)}, before its tree")
    (length,) = _LENGTH.unpack_from(data, at)
    at += _LENGTH.size
    if not 0 <= length <= len(data) - at - _START.size:
        raise UnusableRecordingError(
            f"it ends at byte {len(data)}, but its tree of {length} bytes starts at byte {at}"
        )
    try:
        tree = data[at : at + length].decode()
    except UnicodeDecodeError as error:
        raise UnusableRecordingError(f"byte {at + error.start} of its tree is not UTF-8") from error
    at += length
    (start,) = _START.unpack_from(data, at)
    if not 0 <= start < _LATEST_USEC:
        raise UnusableRecordingError(f"its start time at byte {at} is not a date")
    at += _START.size
    found = Recording("btlog", start / 1e6, tree)
    whole = (len(data) - at) // _CHANGE.size * _CHANGE.size
    if at + whole != len(data):
        found.flaws.append(f"it ends at byte {len(data)}, within a change of status")
    for index, (low, high, uid, status) in enumerate(_CHANGE.iter_unpack(memoryview(data)[at : at + whole])):
        if status > SKIPPED:
            found.flaws.append(
                f"byte {at + index * _CHANGE.size + _CHANGE.size - 1} is not a status: {status}. The rest was skipped"
            )
            break
        found.add(low | high << 32, uid, status)
    return found
