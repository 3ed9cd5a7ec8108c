"""The documentation's notebooks.

`python -m docs.handbook.notebook_page docs/tutorials/python.ipynb` runs one from its first cell to
its last, keeps what the cells show, and writes the page of the site beside it.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

Notebook = Mapping[str, Any]


def run_notebook(notebook: Notebook) -> dict[str, Any]:
    """Run the code cells of a notebook in their order, in one namespace.

    Parameters
    ----------
    notebook
        As its file has it, in JSON.

    Returns
    -------
    dict
        The notebook with new outputs.

    Examples
    --------
    >>> from docs.handbook.notebook_page import run_notebook
    >>> cells = [{"cell_type": "code", "source": text} for text in ("a = 2", "a + 1")]
    >>> run_notebook({"cells": cells})["cells"][1]["outputs"][0]["data"]
    {'text/plain': '3'}
    """
    import matplotlib
    from matplotlib import pyplot

    matplotlib.use("Agg")
    pyplot.close("all")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    cells, count = [], 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            count += 1
            outputs = list(_outputs(_text(cell["source"]), namespace, count))
            cell = cell | {"execution_count": count, "outputs": outputs}
        cells.append(cell)
    return {**notebook, "cells": cells}


def _outputs(code: str, namespace: dict[str, Any], count: int) -> Iterator[dict[str, Any]]:
    from matplotlib import pyplot

    tree, value, printed = ast.parse(code), None, io.StringIO()
    last = tree.body[-1] if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    before = ast.Module(tree.body[:-1] if last else tree.body, [])
    with contextlib.redirect_stdout(printed):
        exec(compile(before, "<cell>", "exec"), namespace)
        if last:
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), namespace)
    if printed.getvalue():
        yield {"output_type": "stream", "name": "stdout", "text": printed.getvalue()}
    if value is not None and not code.rstrip().endswith(";"):
        yield {
            "output_type": "execute_result",
            "execution_count": count,
            "metadata": {},
            "data": {"text/plain": repr(value)},
        }
    for number in pyplot.get_fignums():
        file = io.BytesIO()
        pyplot.figure(number).savefig(file, format="png", dpi=80, bbox_inches="tight")
        data = {"image/png": base64.b64encode(file.getvalue()).decode()}
        yield {"output_type": "display_data", "metadata": {}, "data": data}
    pyplot.close("all")


def make_page(notebook: Notebook, name: str) -> tuple[str, dict[str, bytes]]:
    r"""The notebook as a page in Markdown, and its figures.

    Parameters
    ----------
    notebook
        With its outputs.
    name
        The notebook's, without its ending.

    Returns
    -------
    tuple
        The page's text, and the PNG files by name.

    Examples
    --------
    >>> from docs.handbook.notebook_page import make_page
    >>> cell = {"cell_type": "markdown", "source": "# A gyro"}
    >>> make_page({"cells": [cell]}, "gyro")
    ('# A gyro\n', {})
    """
    parts: list[str] = []
    figures: dict[str, bytes] = {}
    for cell in notebook["cells"]:
        text = _text(cell["source"]).strip()
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        for output in cell.get("outputs", ()):
            shown = _text(output.get("text", output.get("data", {}).get("text/plain", "")))
            if shown:
                parts.append(f"```text\n{shown.rstrip()}\n```")
            if picture := output.get("data", {}).get("image/png"):
                file = f"{name}-{len(figures) + 1}.png"
                figures[file] = base64.b64decode(picture)
                parts.append(f"![What the code above draws]({file})")
    return "\n\n".join(parts) + "\n", figures


def _text(source: str | list[str]) -> str:
    """A text that a notebook may keep as a list of lines."""
    return source if isinstance(source, str) else "".join(source)


def renew(path: Path) -> None:
    r"""Run a notebook; write it with its outputs, its page and its figures.

    Parameters
    ----------
    path
        Of the notebook, beside which page and figures are written.

    Examples
    --------
    >>> import json
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from docs.handbook.notebook_page import renew
    >>> cell = {"cell_type": "markdown", "source": "# A gyro"}
    >>> with TemporaryDirectory() as name:
    ...     file = Path(name) / "gyro.ipynb"
    ...     _ = file.write_text(json.dumps({"cells": [cell]}))
    ...     renew(file)
    ...     file.with_suffix(".md").read_text()
    '# A gyro\n'
    """
    notebook = run_notebook(json.loads(path.read_text(encoding="utf-8")))
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    page, figures = make_page(notebook, path.stem)
    path.with_suffix(".md").write_text(page, encoding="utf-8")
    for name, content in figures.items():
        (path.parent / name).write_bytes(content)


if __name__ == "__main__":
    for place in sys.argv[1:]:
        renew(Path(place))
