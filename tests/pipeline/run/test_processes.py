"""Processes of Dask: who is listened to, and what is said when the scheduler is lost."""

import asyncio
import stat
from concurrent.futures import ThreadPoolExecutor

from distributed.comm import connect, listen
from distributed.security import Security

from pipeline.run.processes import security_of, write_certificate


async def heard_by(listening: Security, speaking: Security | None) -> list[object]:
    heard: list[object] = []

    async def hear(comm):
        heard.append(await comm.read())
        await comm.close()

    async with listen("tls://127.0.0.1:0", hear, **listening.get_listen_args("scheduler")) as listener:
        scheme = "tls" if speaking else "tcp"
        address = listener.contact_address.replace("tls", scheme, 1)
        arguments = speaking.get_connection_args("client") if speaking else {}
        try:
            comm = await connect(address, timeout=2, **arguments)
            await comm.write("hello")
            await comm.close()
        except OSError:
            pass
        await asyncio.sleep(0.05)
    return heard


def test_who_has_no_certificate_is_not_heard(tmp_path):
    for name in ("ours", "another"):
        write_certificate(tmp_path / name / "tls.pem")
        assert stat.S_IMODE((tmp_path / name / "tls.pem").stat().st_mode) == 0o600
    ours, another = (security_of(tmp_path / name / "tls.pem") for name in ("ours", "another"))
    # a browser of other tests may have an event loop in this thread
    with ThreadPoolExecutor(1) as elsewhere:
        heard = [elsewhere.submit(asyncio.run, heard_by(ours, one)).result() for one in (ours, another, None)]
    assert heard == [["hello"], [], []]
