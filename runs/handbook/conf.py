"""Sphinx's settings; `runs.handbook.build` prepares the sources."""

from importlib.metadata import version as installed
from typing import Any

from pygments.lexers.special import TextLexer

project = "thirdbody"
author = "The thirdbody developers"
version = release = installed("thirdbody")
html_title = "thirdbody"
html_theme = "furo"
html_show_sourcelink = False
html_show_copyright = False
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["handbook.css"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
myst_enable_extensions = ["colon_fence", "deflist", "html_image"]
myst_heading_anchors = 3
default_role = "code"  # docstrings name code in single backquotes
autodoc_mock_imports = ["dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "gmsh", "h5py"]
"""Mocked, so that the reference of `finite_strain` is built even without these packages."""
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autosummary_generate = False
napoleon_use_rtype = False


def setup(app: Any) -> None:
    """Let pages whose tutorials were not run show the blocks of their pictures as text."""
    app.add_lexer("picture", TextLexer)
