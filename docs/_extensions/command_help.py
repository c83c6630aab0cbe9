"""The directive `command-help`: what a command prints with --help, always up to date."""

from __future__ import annotations

import contextlib
import io
import os
from unittest.mock import patch

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from geodesic_ocp.cli.main import main


class CommandHelp(Directive):
    """The help of one command of geodesic-ocp, or of all without an argument."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """A literal block with the help."""
        text = io.StringIO()
        with (
            patch.dict(os.environ, {"COLUMNS": "90", "NO_COLOR": "1"}),
            contextlib.redirect_stdout(text),
            contextlib.suppress(SystemExit),
        ):
            main([*self.arguments, "--help"])
        return [nodes.literal_block(text.getvalue(), text.getvalue(), language="text")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
