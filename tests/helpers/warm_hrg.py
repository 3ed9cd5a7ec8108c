"""`hrg` without its imports: a process that has them answers each call by a fork of itself.

Of a block of thirty commands, half a minute was imports. A call has its own process, folder, environment
and streams all the same; that `hrg` itself starts is tested in test_cli.py.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

CLIENT = """#!{python} -SE
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({path!r})
    call = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
    socket.send_fds(server, [len(call).to_bytes(4, "big")], [0, 1, 2])
    server.sendall(call)
    sys.exit((server.recv(1) or bytes([255]))[0])
"""
"""What stands on the PATH as `hrg`; 255 where the answering process was killed."""


@contextmanager
def warm_hrg(folder: Path, root: Path):
    """The text of a script that calls hrg, for as long as the context is open."""
    path = str(folder / "hrg.socket")
    environment = os.environ | {"PYTHONPATH": str(root)}
    command = [sys.executable, __file__, path]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    ) as server:
        try:
            assert server.stdout.readline() == b"ready\n"
            yield CLIENT.format(python=sys.executable, path=path)
        finally:
            server.stdin.close()  # at which it ends, as it does if this process is killed


def answer(connection: socket.socket) -> None:
    """Be the command that was called, in a process of its own."""
    from hrg_cli.cli import main

    size, streams, *_ = socket.recv_fds(connection, 4, 3)
    with connection.makefile("rb") as whole:
        arguments, folder, environment = json.loads(whole.read(int.from_bytes(size, "big")))
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    sys.argv = ["hrg", *arguments]
    status = 0
    try:
        main()
    except SystemExit as leaving:
        status = int(leaving.code or 0)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    connection.sendall(bytes([status]))


def serve(path: str) -> None:
    """Answer calls until standard input ends."""
    from importlib import import_module

    from hrg_cli.cli import COMMANDS

    for module, _ in COMMANDS.values():
        import_module(f"hrg_cli.commands.{module}")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(path)
        listener.listen()
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for those that answered
        os.write(1, b"ready\n")
        while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
            connection, _ = listener.accept()
            if os.fork() == 0:
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                listener.close()
                answer(connection)
                os._exit(0)
            connection.close()


if __name__ == "__main__":
    serve(sys.argv[1])
