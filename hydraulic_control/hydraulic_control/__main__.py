"""``python -m hydraulic_control VERB …``: the verbs of this package."""

from __future__ import annotations

import importlib
import pkgutil
import sys

from hydraulic_control import verbs


def main() -> int:
    """Hand over to a verb; without one, list them."""
    names = sorted(m.name for m in pkgutil.iter_modules(verbs.__path__) if not m.name.startswith("_"))
    if len(sys.argv) > 1 and sys.argv[1] in names:
        return int(importlib.import_module(f"{verbs.__name__}.{sys.argv[1]}").main(sys.argv[2:]))
    asked = sys.argv[1:] in (["-h"], ["--help"])
    text = f"usage: python -m hydraulic_control VERB …   verbs: {', '.join(names)}"
    print(text, file=sys.stdout if asked else sys.stderr)
    return 0 if asked else 2


if __name__ == "__main__":
    sys.exit(main())
