"""Writes the reference of the Python package, `docs/python-reference.md`, from signatures and docstrings.

It reads the Python files and the stub of the compiled part, and imports nothing. `tests/test_reference.py`
fails when the page is stale: `python3 host/python/reference.py` writes it.

griffe2md 1.5 was tried: 6457 lines where this page has 1350, each module told twice, and the docstrings'
roles and double backticks left as they are.
"""

import ast
import inspect
import re
import textwrap
from pathlib import Path

PACKAGE = Path(__file__).parent / "python" / "nirspi"
PAGE = Path(__file__).parents[2] / "docs" / "python-reference.md"
WIDTH = 100

HEAD = """# Python reference

What `import nirspi as ns` has, from the docstrings of the package. [Python package](python.md)
shows how the parts work together. `host/python/reference.py` writes this page, and a test fails
when it is stale; the examples run in the tests.
"""

# Sections of a docstring whose entries are "name : type" with an indented text.
LISTS = {"Parameters", "Attributes", "Returns", "Yields", "Raises"}
SECTION = re.compile(r"^([A-Z][A-Za-z ]+)\n-+$", re.MULTILINE)


def text(words: str) -> str:
    """Markdown of a piece of reStructuredText as the docstrings have it."""
    words = re.sub(r":(?:func|class|meth|mod|attr):`~?([^`]+)`", r"`\1`", words)
    return words.replace("``", "`")


def wrapped(words: str, first: str = "", rest: str = "") -> str:
    """Lines as mdformat wraps them: code and links stay in one line."""
    words = " ".join(words.split())
    words = re.sub(r"`[^`]+`|\[[^\]]+\]\([^)]+\)", lambda span: span[0].replace(" ", "\0"), words)
    lines = textwrap.fill(
        words,
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines.replace("\0", " ")


def paragraphs(words: str) -> str:
    """Paragraphs, lists and examples, each in its own way."""
    parts = []
    for part in re.split(r"\n\s*\n", words.strip()):
        if part.lstrip().startswith(">>>"):
            parts.append("```pycon\n" + textwrap.dedent(part) + "\n```")
        elif part.startswith("    ") or part.lstrip().startswith(("- ", "* ", "|")):
            parts.append(text(textwrap.dedent(part)))
        else:
            parts.append(wrapped(text(part)))
    return "\n\n".join(parts)


def entries(words: str) -> str:
    """Entries "name : type" with indented texts, as a list."""
    made = []
    for entry in re.split(r"\n(?=\S)", words.strip("\n")):
        head, _, body = entry.partition("\n")
        name, colon, kind = (part.strip() for part in head.partition(" : "))
        said = f"`{name}`" + (f" ({text(kind)})" if colon else "")
        body = text(textwrap.dedent(body)).strip()
        made.append(wrapped(f"{said}: {body}" if body else said, "- ", "  "))
    return "\n".join(made)


def docstring(doc: str | None) -> str:
    if not doc:
        return ""
    doc = inspect.cleandoc(doc)
    pieces = SECTION.split(doc)
    made = [paragraphs(pieces[0])]
    for name, body in zip(pieces[1::2], pieces[2::2], strict=True):
        made.append(f"**{name}**")
        made.append(entries(body) if name in LISTS else paragraphs(body))
    return "\n\n".join(part for part in made if part)


def signature(name: str, function: ast.FunctionDef | ast.AsyncFunctionDef, method: bool) -> str:
    """The signature without annotations, one line or one argument a line."""
    arguments = function.args
    plain = arguments.posonlyargs + arguments.args
    if method and not any(getattr(d, "id", "") == "staticmethod" for d in function.decorator_list):
        plain = plain[1:]
    missing = len(plain) - len(arguments.defaults)
    said = [
        argument.arg + (f"={ast.unparse(arguments.defaults[at - missing])}" if at >= missing else "")
        for at, argument in enumerate(plain)
    ]
    if arguments.vararg:
        said.append("*" + arguments.vararg.arg)
    elif arguments.kwonlyargs:
        said.append("*")
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        said.append(argument.arg + (f"={ast.unparse(default)}" if default else ""))
    if arguments.kwarg:
        said.append("**" + arguments.kwarg.arg)
    line = f"{name}({', '.join(said)})"
    if len(line) > WIDTH:
        line = wrapped(line, "", "    ")
    return f"```python\n{line}\n```"


def is_property(function: ast.AST) -> bool:
    return any(getattr(d, "id", "") == "property" for d in getattr(function, "decorator_list", []))


def is_setter(function: ast.AST) -> bool:
    return any(getattr(d, "attr", "") == "setter" for d in getattr(function, "decorator_list", []))


def functions(of: ast.ClassDef) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    found = [node for node in of.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    return [node for node in found if not node.name.startswith("_") and not is_setter(node)]


def of_class(name: str, node: ast.ClassDef) -> list[str]:
    made = [f"## `{name}`"]
    init = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
    made += [signature(f"ns.{name}", init[0], True)] if init else []
    made.append(docstring(ast.get_docstring(node, clean=False)))
    made += [docstring(ast.get_docstring(init[0], clean=False))] if init else []
    for function in functions(node):
        doc = ast.get_docstring(function, clean=False)
        if not doc:
            continue
        made.append(f"### `{name}.{function.name}`")
        if not is_property(function):
            made.append(signature(function.name, function, True))
        made.append(docstring(doc))
    return made


def of_function(name: str, node: ast.FunctionDef) -> list[str]:
    doc = docstring(ast.get_docstring(node, clean=False))
    return [f"## `{name}`", signature(f"ns.{name}", node, False), doc]


def of_module(name: str) -> list[str]:
    """A module that the package hands out: its public functions and classes."""
    tree = ast.parse((PACKAGE / f"{name}.py").read_text())
    made = [f"## `{name}`", docstring(ast.get_docstring(tree, clean=False))]
    for node in tree.body:
        if getattr(node, "name", "_").startswith("_"):
            continue
        if isinstance(node, ast.FunctionDef):
            _, said, doc = of_function(f"{name}.{node.name}", node)
            made += [f"### `{name}.{node.name}`", said, doc]
        elif isinstance(node, ast.ClassDef):
            made += [
                f"#{line}" if line.startswith("## ") else line
                for line in of_class(f"{name}.{node.name}", node)
            ]
    return made


def public() -> tuple[list[str], set[str]]:
    """The names that the package hands out, in its own order, and those of them that are modules."""
    names: list[str] = []
    modules: set[str] = set()
    for node in ast.parse((PACKAGE / "__init__.py").read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module is None:
            modules |= {alias.name for alias in node.names}
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            names = ast.literal_eval(node.value)
    return names, modules


def page() -> str:
    places = {}
    for file in [*sorted(PACKAGE.glob("*.py")), PACKAGE / "_nirspi.pyi"]:
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, node)
    made = [HEAD.strip()]
    names, modules = public()
    for name in names:
        if name in modules:
            made += of_module(name)
        elif isinstance(places.get(name), ast.ClassDef):
            made += of_class(name, places[name])
        else:
            made += of_function(name, places[name])
    return "\n\n".join(part for part in made if part) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
