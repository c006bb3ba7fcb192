"""What an experiment returns."""

from dataclasses import dataclass
from typing import Any

# matplotlib is an extra and has no type stubs; its figures are spelled this way for the reader.
Figure = Any


@dataclass(frozen=True)
class Result:
    """Numbers, figures and words of one experiment.

    Attributes
    ----------
    title : str
        Heading of its page.
    tables : dict of str to list of dict
        Rows by the name of the table: written as NAME.csv, and all together to results.json.
    figures : dict of str to matplotlib.figure.Figure
        Written as NAME.pdf and NAME.png.
    text : str
        Markdown: the paper's figures beside ours, where they agree and where not.
    """

    title: str
    tables: dict[str, list[dict[str, object]]]
    figures: dict[str, Figure]
    text: str
