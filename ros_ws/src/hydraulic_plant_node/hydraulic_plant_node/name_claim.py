"""One process of this machine per name: a claim that the system takes back when its process ends, however it ends."""

from __future__ import annotations

import errno
import hashlib
import socket


class NameClaim:
    """A claim to `name`, kept from `take` to `give_back` or to the end of the process."""

    def __init__(self, name: str) -> None:
        # A socket in the abstract name space of Linux leaves no file behind; its names are short.
        self._address = "\0hydraulic_bench." + hashlib.sha256(name.encode()).hexdigest()
        self._socket: socket.socket | None = None

    def take(self) -> bool:
        """Whether the name is claimed now; False while another claim to it stands."""
        if self._socket is not None:
            return True
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(self._address)
        except OSError as error:
            claim.close()
            if error.errno == errno.EADDRINUSE:
                return False
            raise
        self._socket = claim
        return True

    def give_back(self) -> None:
        """Let another process claim the name."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
