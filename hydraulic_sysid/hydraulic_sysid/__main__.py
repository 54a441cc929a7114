"""``python -m hydraulic_sysid VERB …``: the verbs are the modules of `hydraulic_sysid.verbs`."""

from __future__ import annotations

import ast
import pkgutil
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from hydraulic_sysid import verbs


def verb_names() -> list[str]:
    """Names of all verbs, sorted."""
    return sorted(m.name for m in pkgutil.iter_modules(verbs.__path__) if not m.name.startswith("_"))


def summary(verb: str) -> str:
    """First line of a verb's docstring, read from its source: importing all verbs would be slow."""
    spec = find_spec(f"{verbs.__name__}.{verb}")
    assert spec is not None and spec.origin is not None
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


def main(argv: list[str] | None = None) -> int:
    """Run the named verb with the remaining arguments; its exit code, or 2 for an unknown verb."""
    arguments = sys.argv[1:] if argv is None else argv
    names = verb_names()
    if not arguments or arguments[0] in ("-h", "--help"):
        print("usage: python -m hydraulic_sysid VERB …   (VERB --help for its options)\n")
        width = max(map(len, names)) + 2
        print("\n".join(f"  {name:<{width}}{summary(name)}" for name in names))
        return 0 if arguments else 2
    if arguments[0] not in names:
        print(f"hydraulic_sysid: no verb {arguments[0]!r}; there are {', '.join(names)}", file=sys.stderr)
        return 2
    return int(import_module(f"{verbs.__name__}.{arguments[0]}").main(arguments[1:]))


if __name__ == "__main__":
    sys.exit(main())
