"""`show`: a controller in words and tables."""

from fis_tools.commands.arguments import AskedInOrder
from fis_tools.document import text
from fis_tools.words.outline import outline


def run(asked: AskedInOrder) -> None:
    """Print variables, terms and rule tables.

    For example:

        python -m fis_tools show controller.yaml
        python -m fis_tools show tipper.fis
        python -m fis_tools show outputs/train/20250101-120000-000000 --system force_x
        python -m fis_tools show controller.yaml --by importance --flights episodes/*.mcap
    """
    controller = asked.read()
    print(text.write(outline(controller, asked.importance(controller))), end="")
