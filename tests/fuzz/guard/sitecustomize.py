"""Python imports this first: it notes, and forbids, writing elsewhere and the network."""

import os
import sys

_ALLOWED = tuple(os.path.realpath(p) for p in os.environ["NBV_FUZZ_ALLOWED"].split(os.pathsep))
_NOTES = os.open(os.environ["NBV_FUZZ_NOTES"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
_PATH_EVENTS = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.truncate", "os.link"}
_FORBIDDEN = ("socket.connect", "socket.getaddrinfo", "os.system", "os.exec", "pickle.find_class")


def _is_elsewhere(path: object) -> bool:
    if not isinstance(path, str | bytes | os.PathLike):
        return False
    real = os.path.realpath(os.fsdecode(path))
    return not real.startswith(_ALLOWED) and "__pycache__" not in real and real != os.devnull


def _watch(event: str, arguments: tuple) -> None:
    if event == "open":
        path, mode, flags = arguments
        writes = (mode and set(mode) & set("wax+")) or (flags or 0) & (os.O_WRONLY | os.O_RDWR)
        bad = writes and _is_elsewhere(path)
    else:
        bad = event.startswith(_FORBIDDEN) or (
            event in _PATH_EVENTS and any(map(_is_elsewhere, arguments))
        )
    if bad:
        os.write(_NOTES, ascii((event, *arguments))[:300].encode() + b"\n")
        raise PermissionError(f"forbidden while a file is fuzzed: {event}")


sys.addaudithook(_watch)
