"""Configuration of the documentation site; `make docs` builds it into docs/_build/html."""

from __future__ import annotations

import shutil
import sys
from importlib.metadata import metadata
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_extensions"))

from pages import write_commands, write_notebooks  # noqa: E402
from public_names import public_names  # noqa: E402

# Notebooks and gallery are kept once, in folders of their own, and copied for each build.
COMMANDS, EXTRA = HERE / "reference" / "generated" / "commands", HERE / "_extra"
for made in (HERE / "problems", COMMANDS.parent, EXTRA):
    shutil.rmtree(made, ignore_errors=True)
shutil.copytree(ROOT / "problems", HERE / "problems", ignore=shutil.ignore_patterns("__pycache__"))
COMMANDS.mkdir(parents=True)
write_commands(COMMANDS)
(EXTRA / "viewers").mkdir(parents=True)
write_notebooks(ROOT / "notebooks", HERE / "tutorials", EXTRA / "viewers")

project = "geodesic_ocp"
author = "The geodesic_ocp developers"
project_copyright = author
release = version = version_of("geodesic_ocp")

extensions = [
    "docstrings",
    "mathml",
    "myst_nb",
    "public_names",
    "names_table",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "tutorials/cards.md"]
templates_path = ["_templates"]
html_theme = "furo"
html_title = f"geodesic_ocp {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["frames.js"]
html_extra_path = ["_extra"]
# Addresses in [project.urls] of pyproject.toml, such as the repository, are in the navigation.
_URLS = metadata("geodesic_ocp").get_all("Project-URL") or ()
html_context = {"addresses": [line.split(", ", 1) for line in _URLS]}
html_search_scorer = str(HERE / "_static" / "scorer.js")
html_show_sourcelink = False
html_math_renderer = "mathml"  # no script, nothing to fetch

myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_render_markdown_format = "gfm"  # with tables
nb_execution_mode = "off"  # the notebooks' stored outputs are shown; CI executes them
nb_output_stderr = "remove"  # progress bars
copybutton_exclude = ".linenos, .gp, .go"

# Docstrings are plain text with `names` between single backticks.
default_role = "py:obj"
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings give types, shapes and units
autosummary_generate = True
_NAMES = public_names()
autosummary_filename_map = {  # apart from geodesic and replay where case does not count
    f"geodesic_ocp.{name}": f"geodesic_ocp.{name}_class"
    for name in _NAMES
    if name != name.lower() and name.lower() in _NAMES
}
napoleon_attr_annotations = False
napoleon_use_param = False  # a description of several parameters is shown once
