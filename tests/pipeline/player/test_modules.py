"""The modules of pages tell nothing of the machine that built them."""

from pipeline.player.build import FOLDER
from tests.fis_tools.compiled.shipped.made import TELLING


def test_no_module_tells_where_it_was_built():
    modules = {path.name: path.read_bytes() for path in FOLDER.glob("*.wasm")}
    assert modules
    assert [name for name, content in modules.items() if TELLING.search(content)] == []
