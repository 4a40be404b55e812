"""What `upright new` writes: one rule, in plain Python and compiled.

Both files are working modules as they stand, and give the same trials from the same seed.
"""

import ast
import re
from pathlib import Path

from upright.errors import UprightError

PLAIN, COMPILED = "my_agent.py", "my_compiled_agent.py"
CLASS, FUNCTION = "MyAgent", "my_agent"
"""Names in these files that others take the place of."""


def starter(module: str, *, compiled: bool = False) -> tuple[str, str]:
    """Return the name of the agent in a new module, and the text of the module.

    Parameters
    ----------
    module
        Name of the module, from which those of its class and its function are made.
    compiled
        Whether the agent is to be compiled. It is then the function that creates it.

    Raises
    ------
    UprightError
        If these names would hide others that the agent needs.
    """
    name = "".join(part[:1].upper() + part[1:] for part in module.split("_"))
    function = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", module).lower()
    text = (Path(__file__).parent / (COMPILED if compiled else PLAIN)).read_text("utf-8")
    for hidden in {name, function if compiled else name} & _names(text) - {CLASS, FUNCTION}:
        raise UprightError(
            f"file is '{module}.py'; its agent would hide {hidden!r}, which it uses; "
            f"try '{module}_agent.py'"
        )
    text = text.replace(CLASS, name).replace(FUNCTION, function)
    return function if compiled else name, text


def _names(text: str) -> set[str]:
    """Return the names that a module uses or defines, except attributes."""
    names = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Name(id=name) | ast.alias(name=name) | ast.arg(arg=name):
                names.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
    return names
