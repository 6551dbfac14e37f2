"""docs/formats/report.md explains report.yaml: a field or warning that it does not know is one nobody can look up."""

import ast
import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from reflectance_fit.report import schema

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "formats" / "report.md").read_text(encoding="utf-8")
# `eta`, and `effort.seconds` for a field of effort
NAMED = {part for code in re.findall(r"`([^`\n]+)`", PAGE) for part in re.split(r"[.:\s]+", code)}
MODELS = [
    m
    for m in vars(schema).values()
    if isinstance(m, type) and issubclass(m, BaseModel) and m is not BaseModel
]
FIELDS = sorted({field.alias or name for model in MODELS for name, field in model.model_fields.items()})
CODES = set(get_args(schema.Warning.model_fields["code"].annotation))
GIVEN, RESERVED = PAGE.split("## Warnings")[1].split("## posterior.nc")[0].split("Reserved, ")


def test_the_schema_was_found():
    assert len(FIELDS) > 50
    assert {"schema", "rhat_nested_max", "nan_evaluations"} <= set(FIELDS)


@pytest.mark.parametrize("field", FIELDS)
def test_every_field_is_on_the_page(field):
    assert field in NAMED


@pytest.mark.parametrize("status", get_args(schema.Status))
def test_every_status_is_on_the_page(status):
    assert re.search(rf"^\| `{status}` \|", PAGE, re.MULTILINE)


def test_every_code_is_on_the_page_and_never_twice():
    reserved = re.findall(r"`([A-Z]+(?:_[A-Z]+)+)`", RESERVED)
    rows = set(re.findall(r"^\| `([A-Z_]+)` \|", GIVEN, re.MULTILINE))
    assert rows | set(reserved) == CODES
    assert not rows & set(reserved)


def test_the_codes_not_reserved_are_those_that_the_program_gives():
    # The schema only lists them.
    files = [f for f in (ROOT / "reflectance_fit").rglob("*.py") if f.name != "schema.py"]
    texts = {
        node.value
        for file in files
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert texts & CODES == set(re.findall(r"^\| `([A-Z_]+)` \|", GIVEN, re.MULTILINE))
