"""The project itself: what is imported, in which direction, and what its files say of it."""

import ast
import importlib
import importlib.metadata
import importlib.util
import inspect
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import chuteflow

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src" / "chuteflow"

# Ground floor first; a module imports from its own layer and from those before it.
LAYERS = (
    "numerics",
    "theory",
    "steady",
    "trajectories",
    "branches",
    "bifurcations",
    "maps",
    "stability",
    "sweeps",
    "fitting",
    "io",
    "dem",
    "plotting",
    "paper",
    "explorer",
    "cli",
)
# What `import chuteflow` offers is made of the layers up to this one, so only those above it may use it; the version
# is a number of its own, which files and stores name.
PUBLIC_API = "io"
VERSION = "chuteflow.__version__"

MODULES = {
    ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(SOURCE.rglob("*.py"))
}


# The installed package


def test_the_installed_package_is_tested_not_the_source_folder():
    assert not Path(chuteflow.__file__).resolve().is_relative_to(SOURCE.parent)


def test_the_installed_package_is_that_of_the_source_folder():
    installed = Path(chuteflow.__file__).parent

    def contents(folder: Path) -> dict[str, bytes]:
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.py")}

    there, here = contents(installed), contents(SOURCE)
    differing = {name for name in there.keys() | here.keys() if there.get(name) != here.get(name)}
    assert not differing, "the installed wheel is out of date; `make test` renews it"


@pytest.mark.skipif(shutil.which("make") is None or os.name == "nt", reason="no make, or no links")
def test_make_leaves_an_environment_alone_that_is_only_linked_to(tmp_path):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    others = tmp_path / "others"
    others.mkdir()
    (others / "kept").touch()
    (tmp_path / ".venv").symlink_to(others)
    done = subprocess.run(["make", f"PYTHON={sys.executable}", "wheel"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert ".venv is a link to another environment, which make leaves alone; remove the link" in done.stderr
    assert (others / "kept").exists()


def test_versions_agree():
    version = chuteflow.__version__
    assert importlib.metadata.version("chuteflow") == version
    for name in ("CITATION.cff", ".zenodo.json", "packaging/conda/meta.yaml"):
        told = re.findall(r'^ *"?version"?: *"?([^",\n]+)', (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        assert told == [version], name
    assert f"\n## [{version}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_recipe_for_conda_has_the_same_requirements():
    def names(requirements):
        return {re.split(r"[^\w-]", one)[0].replace("-base", "") for one in requirements}

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [
        *project["dependencies"],
        *(one for name in ("explore", "sweep", "tables", "units") for one in extras[name]),
    ]
    recipe = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8")
    run = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    assert names(re.findall(r"- (\S+)", run)) - {"python"} == names(asked)


@pytest.mark.parametrize(
    ("package", "arguments", "extra"),
    [
        ("uvicorn", ["explore", "--port", "0", "--no-browser"], "explore"),
        ("starlette", ["explore", "--port", "0", "--no-browser"], "explore"),
        ("pint", ["solve", "--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6", "--flux", "3 m^2/s",
                  "--diameter", "1 mm", "--density", "2500 kg/m^3"], "units"),
        ("distributed", ["sweep", "study.toml", "--out", "study.zarr", "--cluster", "127.0.0.1:1"], "cluster"),
        ("zarr", ["sweep", "study.toml", "--out", "study.zarr"], "sweep"),
    ],
)  # fmt: skip
def test_without_the_package_of_an_extra_a_line_says_what_to_install(package, arguments, extra, tmp_path):
    (tmp_path / "study.toml").write_text(
        "[parameters]\nslope = 0.3\ne = 0.8\new = 0.8\nroughness = 0.6\nT_surface = [1.0, 2.0]\n", encoding="utf-8"
    )
    code = f"import sys; sys.modules['{package}'] = None\nfrom chuteflow.__main__ import run\nsys.exit(run())"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].endswith(f"which is not installed: pip install 'chuteflow[{extra}]'")
    assert "Traceback" not in done.stderr


# The checks


@pytest.mark.skipif(shutil.which("bash") is None, reason="the checks are a script of bash")
@pytest.mark.parametrize(("arguments", "code"), [(["--help"], 0), (["-h"], 0), (["tests"], 2), (["--fast", "x"], 2)])
def test_the_checks_take_no_arguments(arguments, code):
    done = subprocess.run([ROOT / ".ci/run", *arguments], capture_output=True, text=True, check=False, timeout=10)
    assert done.returncode == code
    assert len((done.stdout + done.stderr).splitlines()) == 1


@pytest.mark.parametrize(
    "path", [*(ROOT / "docs").rglob("*.py"), *(ROOT / "benchmarks").glob("*.py")], ids=lambda p: p.name
)
def test_what_pages_and_benchmarks_import_is_there(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] == "chuteflow":
            module = importlib.import_module(str(node.module))
            for name in (alias.name for alias in node.names):
                assert hasattr(module, name) or importlib.util.find_spec(f"{module.__name__}.{name}"), name


# The layers


def layer_of(module: str) -> str | None:
    """The layer that a dotted name belongs to; None for the modules at the top of the package."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in LAYERS else None


def imported_from_package(module: str, source: str, *, is_package: bool = False) -> Iterator[tuple[int, str]]:
    """Line number and dotted name of everything of chuteflow that the source imports, wherever in it."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = module.split(".")
            base = base[: len(base) - node.level + is_package] if node.level else []
            start = ".".join(base + (node.module.split(".") if node.module else []))
            names = [f"{start}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            if name.split(".")[0] == "chuteflow":
                yield node.lineno, name


def upward_edges(module: str, source: str, *, is_package: bool = False) -> list[str]:
    """What a module imports from above itself, as sentences; the root and __main__ import freely."""
    if module in ("chuteflow", "chuteflow.__main__"):
        return []
    layer = layer_of(module)
    height = LAYERS.index(layer) if layer else -1
    found = []
    for line, name in imported_from_package(module, source, is_package=is_package):
        target = layer_of(name)
        if target:
            upward = LAYERS.index(target) > height
        elif name == VERSION or (name != "chuteflow" and ".".join(name.split(".")[:2]) in MODULES):
            upward = False
        else:
            upward = height <= LAYERS.index(PUBLIC_API)
        if upward:
            found.append(f"{module}, line {line}, imports {name}")
    return found


def test_every_folder_of_the_package_is_a_layer():
    folders = {path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py") if path.parent != SOURCE}
    assert folders == set(LAYERS)


def test_what_the_package_offers_is_not_above_its_layer():
    homes = {name: layer_of(f"chuteflow.{home}") for name, home in chuteflow._HOMES.items()}
    allowed = {None, *LAYERS[: LAYERS.index(PUBLIC_API) + 1]}
    assert {name: layer for name, layer in homes.items() if layer not in allowed} == {}


def module_named(name: str) -> str | None:
    """The longest part of a dotted name that is a module of the package."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        if (found := ".".join(parts[:length])) in MODULES:
            return found
    return None


def imported_at_once(module: str) -> set[str]:
    """The modules that are imported when ``module`` is: not those of functions, nor of types alone."""
    path = MODULES[module]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    late = {
        node.lineno
        for part in ast.walk(tree)
        if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef)
        or (isinstance(part, ast.If) and ast.unparse(part.test) == "TYPE_CHECKING")
        for node in ast.walk(part)
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    names = imported_from_package(module, path.read_text(encoding="utf-8"), is_package=path.name == "__init__.py")
    found = {module_named(name) for line, name in names if line not in late}
    return {name for name in found if name not in (None, "chuteflow", module)}


def circles(imports: dict[str, set[str]]) -> set[str]:
    """The modules that import one another in a circle: what is left when those that import nothing left are taken."""
    left = {module: set(targets) for module, targets in imports.items()}
    while done := [module for module, targets in left.items() if not targets & left.keys()]:
        for module in done:
            del left[module]
    # The modules above a circle are left over too.
    while done := [module for module in left if not any(module in targets for targets in left.values())]:
        for module in done:
            del left[module]
    return set(left)


def test_no_imports_go_in_a_circle():
    assert circles({module: imported_at_once(module) for module in MODULES}) == set()


def test_a_circle_of_imports_is_seen():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == {"b", "c"}
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == set()


@pytest.mark.parametrize("floor", ["paper", "explorer"])
def test_nothing_but_the_command_line_imports_the_clients(floor):
    found = [
        f"{module}, line {line}, imports {name}"
        for module, path in MODULES.items()
        if layer_of(module) not in (floor, "cli")
        for line, name in imported_from_package(
            module, path.read_text(encoding="utf-8"), is_package=path.name == "__init__.py"
        )
        if layer_of(name) == floor
    ]
    assert found == []


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_downward(module):
    path = MODULES[module]
    source = path.read_text(encoding="utf-8")
    assert upward_edges(module, source, is_package=path.name == "__init__.py") == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("chuteflow.numerics.newton", "import chuteflow.theory.closures"),
        ("chuteflow.numerics.newton", "from chuteflow import theory"),
        ("chuteflow.numerics.newton", "from ..theory import closures"),
        ("chuteflow.theory.closures", "from chuteflow.steady.solver import solve"),
        ("chuteflow.steady.solver", "def f():\n    from ..branches import curve"),
        ("chuteflow.branches.curve", "from .. import paper"),
        ("chuteflow.branches.curve", "import chuteflow"),
        ("chuteflow.branches.curve", "from chuteflow import Chute"),
        ("chuteflow.io.files", "from chuteflow.plotting.plots import draw"),
        ("chuteflow.io.files", "from chuteflow import Chute"),
        ("chuteflow.paper.figures", "from chuteflow.cli.options import size"),
        ("chuteflow.errors", "from chuteflow import numerics"),
    ],
)
def test_an_upward_import_is_seen(module, source):
    assert len(upward_edges(module, source)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("chuteflow.numerics.newton", "import numpy\nfrom . import grids\nfrom .grids import nodes"),
        ("chuteflow.steady.solver", "from ..theory.closures import f_1\nfrom chuteflow import numerics"),
        ("chuteflow.paper.figures", "import chuteflow\nfrom chuteflow import Chute, flows"),
        ("chuteflow.cli.program", "from .. import __version__\nfrom ..paper import figures"),
        ("chuteflow.sweeps.store", "from chuteflow import __version__"),
    ],
)
def test_a_downward_import_is_allowed(module, source):
    assert upward_edges(module, source) == []


def test_a_package_is_the_base_of_its_relative_imports():
    assert list(imported_from_package("chuteflow.steady", "from .solver import f", is_package=True)) == [
        (1, "chuteflow.steady.solver.f")
    ]


#: What a drawing calls of the layers that compute: the order of the flows of a branch, and a smooth line through them.
DRAWING = {"chuteflow.branches.lines.in_order", "chuteflow.branches.lines.runs", "chuteflow.branches.lines.smooth"}
COMPUTING = LAYERS[LAYERS.index("trajectories") : LAYERS.index("io")]


def functions_imported(module: str) -> set[str]:
    """The functions of the layers that compute which a module imports."""
    names = {name for _, name in imported_from_package(module, MODULES[module].read_text(encoding="utf-8"))}
    found = {
        (name, *name.rpartition(".")[::2]) for name in names if layer_of(name) in COMPUTING and name not in MODULES
    }
    return {name for name, home, part in found if inspect.isfunction(getattr(import_module(home), part))}


def test_pictures_compute_nothing():
    drawn = {module: functions_imported(module) - DRAWING for module in MODULES if layer_of(module) == "plotting"}
    assert {module: found for module, found in drawn.items() if found} == {}
    assert functions_imported("chuteflow.bifurcations.diagram") > {"chuteflow.bifurcations.regions.count_flows"}


def class_names(sources: dict[str, str]) -> dict[str, list[str]]:
    """The modules that define a class of each name; a leading underscore makes no other name of one."""
    found: dict[str, list[str]] = {}
    for module, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name.lstrip("_"), []).append(module)
    return found


def test_a_class_name_has_one_meaning():
    names = class_names({module: path.read_text(encoding="utf-8") for module, path in MODULES.items()})
    assert {name: modules for name, modules in names.items() if len(modules) > 1} == {}


def test_a_class_name_with_two_meanings_is_seen():
    assert class_names({"a": "class Point: ...", "b": "class _Point: ...\nclass Line: ..."}) == {
        "Point": ["a", "b"],
        "Line": ["b"],
    }


def named_objects() -> Iterator[tuple[Path, str]]:
    """The dotted names to which the documentation and the docstrings refer."""
    role = re.compile(r"(?:\{py:\w+\}|:(?:class|func|meth|attr|data|mod):)`~?(chuteflow[\w.]*)`")
    for path in [*(ROOT / "docs").rglob("*.md"), *MODULES.values()]:
        for found in role.finditer(path.read_text(encoding="utf-8")):
            yield path.relative_to(ROOT), found[1]


def exists(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    module = module_named(name)
    if module is None:
        return False
    found: object = import_module(module)
    for part in name.removeprefix(module).strip(".").split(".") if name != module else ():
        if part in getattr(found, "__dataclass_fields__", {}):
            return True
        if not hasattr(found, part):
            return False
        found = getattr(found, part)
    return True


def test_the_documentation_refers_to_what_exists():
    assert [(str(path), name) for path, name in named_objects() if not exists(name)] == []
    assert not exists("chuteflow.trajectories.kernel.walk")
    assert not exists("chuteflow.walk")


def test_only_the_command_line_prints():
    calls = [
        f"{module}, line {node.lineno}"
        for module, path in MODULES.items()
        if layer_of(module) != "cli"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert calls == []


# The words

#: Words for which numerical analysis and granular physics have their own terms, named in the comments.
UNUSUAL_WORDS = re.compile(
    r"\b(?:fans?|born|torn|landscapes?|knots?"  # refined trajectory grid, inserted, unresolved, residual, point
    r"|climb(?:s|ed|ing)?|summits?|judg(?:e|ed|es|ing)|lanes?"  # maximisation, maximum, examined, batch element or pool
    r"|grips?|glides?|levers?|paces?|laden|warmth|anew|faces)\b",  # what they are physically; again; cli, io, plotting
    re.IGNORECASE,
)
TEXTS = (".py", ".js", ".html", ".css", ".md", ".ipynb", ".toml")


# The change log tells what was renamed.
@pytest.mark.parametrize("place", ["src", "docs", "benchmarks", "README.md", "CONTRIBUTING.md"])
def test_no_unusual_words(place):
    paths = [ROOT / place, *(ROOT / place).rglob("*")]
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()[:100]}"
        for path in sorted(paths)
        if path.suffix in TEXTS
        for line in path.read_text(encoding="utf-8").splitlines()
        if UNUSUAL_WORDS.search(line)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("line", "is_unusual"),
    [
        ("the fan of trajectories", True),
        ("Born between two", True),
        ("judge(flow)", True),
        ("a space, a fanfare", False),
    ],
)
def test_unusual_words_are_seen(line, is_unusual):
    assert bool(UNUSUAL_WORDS.search(line)) == is_unusual


# The files

# Put together here, so that this file does not hold what it looks for.
OWN_FOLDERS = re.compile(r"(?<![\w.~)}-])/(?:" + "|".join(("work", "root", "home")) + r")(?![\w-])")
REGISTRIES = re.compile(
    "|".join(
        re.escape(".".join(host))
        for host in [("pypi", "org"), ("pypi", "python", "org"), ("pythonhosted", "org"), ("anaconda", "org")]
    )
)


def project_files() -> list[Path]:
    """The files that are, or would be, committed."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    # A checkout may belong to another user than the one who tests it.
    command = [git, "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def local_places(text: str) -> list[str]:
    """Lines of a text that name a folder of one machine or a package registry."""
    return [line for line in text.splitlines() if OWN_FOLDERS.search(line) or REGISTRIES.search(line)]


def test_no_file_names_a_folder_of_one_machine_or_a_registry():
    found = []
    for path in project_files():
        content = path.read_bytes()
        if b"\0" not in content:
            text = content.decode("utf-8", errors="replace")
            found += [f"{path.relative_to(ROOT)}: {line.strip()[:100]}" for line in local_places(text)]
    assert found == []


@pytest.mark.parametrize(
    ("line", "is_local"),
    [
        ("open('/" + "home/someone/x')", True),
        ("file:///" + "root/x", True),
        ("cd /" + "work", True),
        ("--index-url https://" + "pypi" + ".org/simple", True),
        ("the frame/work of 1/root", False),
        ("https://example.org/home/page", False),
        ("$(HOME)/work and ~/work", False),
    ],
)
def test_local_places_are_seen(line, is_local):
    assert bool(local_places(line)) == is_local
