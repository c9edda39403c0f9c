"""The documentation site: MyST pages, a reference generated from the package, and nothing from the network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import chuteflow

project = "chuteflow"
author = "the chuteflow authors"
project_copyright = author
version = release = chuteflow.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "docstrings",
    "equations",
    "modules",
    "commands",
    "tables",
    "pictures",
    "notebook",
    "convergence",
    "profiles",
    "present",
    "offline",
    "accessible",
]
if "quick" not in tags:  # noqa: F821, Sphinx gives it
    extensions.append("sphinx.ext.viewcode")
exclude_patterns = ["_ext"]

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"Array": "Array", "ArrayLike": "ArrayLike", "Field": "Field"}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
add_module_names = False
napoleon_numpy_docstring = False

man_pages = [("reference/commands", "chuteflow", "steady flows of grains down a chute", [author], 1)]

html_theme = "furo"
html_title = "chuteflow"
html_static_path = ["_static"]
html_css_files = ["chuteflow.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
