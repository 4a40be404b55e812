"""What `upright watch` serves the page with."""

from threading import Thread
from urllib.request import urlopen

import pytest

from upright.errors import UprightError
from upright.live.static_server import static_server


def test_it_serves_this_machine_alone_and_refuses_a_port_that_is_taken(tmp_path):
    (tmp_path / "index.html").write_text("here")
    with static_server(tmp_path, 0) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        assert server.server_address[0] == "127.0.0.1"
        assert urlopen(f"http://127.0.0.1:{server.server_port}").read() == b"here"
        taken = pytest.raises(UprightError, match=r"port is \d+; nothing can listen there")
        with taken, static_server(tmp_path, server.server_port):
            pass
        server.shutdown()
