"""Documents of results that are not what their schema promises: a page without foreign markup, or an error."""

from __future__ import annotations

import json
import os
import random
import re
from functools import lru_cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.data.results import ResultError
from hydraulic_sysid.linear import bandwidth
from hydraulic_sysid.linear.identification import identify
from hydraulic_sysid.report import render

from . import must
from .values import anything, number

PAYLOAD = "<img src=x onerror=alert(1)>\"'&"
DOCUMENTS = "HYDRAULIC_FUZZ_DOCUMENTS"
"""Environment variable: a folder of further documents (the JSON of any verb) to damage."""
_SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"
_FIGURE = re.compile(r'<script type="application/json"[^>]*>(.*?)</script>', re.S)


@lru_cache
def _documents() -> list[dict[str, Any]]:
    records = [r.window(2.0, 5.0) for r in read_all([_SAMPLE / "steps.csv.gz"])]
    model = load_model("sample_bench")
    found = [
        identify(records)[0],
        bandwidth.document(bandwidth.from_model(model), {"kind": "model", "name": "x", "path": ""}),
    ]
    folder = os.environ.get(DOCUMENTS)
    if folder:
        found += [results.read_result(path) for path in sorted(Path(folder).glob("**/*.json"))]
    return [json.loads(json.dumps(_thin(results.plain(document)))) for document in found]


def _thin(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _thin(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_thin(item) for item in value[:60]]
    return value


def _places(value: Any) -> list[tuple[Any, Any]]:
    items = (
        list(value.items()) if isinstance(value, dict) else list(enumerate(value)) if isinstance(value, list) else []
    )
    return [(value, key) for key, _ in items] + [place for _, item in items for place in _places(item)]


def _strange(rng: random.Random, old: Any) -> Any:
    if rng.random() < 0.5:
        return str(old) + PAYLOAD if isinstance(old, str) and rng.random() < 0.5 else PAYLOAD
    return rng.choice((None, {}, [], "\ud800", number(rng), anything(rng), {PAYLOAD: PAYLOAD}, [PAYLOAD]))


def reports(rng: random.Random, folder: Path) -> int:
    """Result documents with entries of another kind, most of them markup."""
    count = 5
    for _ in range(count):
        document = json.loads(json.dumps(rng.choice(_documents())))
        for _ in range(rng.choice((1, 1, 2, 5))):
            holder, key = rng.choice(_places(document))
            if key == "schema":
                continue
            if isinstance(holder, dict) and rng.random() < 0.1:
                holder[str(key) + PAYLOAD] = holder.pop(key)
            else:
                holder[key] = _strange(rng, holder[key])
        (folder / "result.json").write_text(json.dumps(document))
        try:
            with patch("hydraulic_sysid.report.page.get_plotlyjs", lambda: ""):
                page = render(results.read_folder(folder / "result.json"))
        except ResultError as error:
            must(len(str(error)) < 2000, "a long error")
            continue
        must("<img" not in page, "markup of a document stands in the page")
        for figure in _FIGURE.findall(page):
            must("<img" not in json.dumps(json.loads(figure)), "markup of a document stands in a figure")
    return count
