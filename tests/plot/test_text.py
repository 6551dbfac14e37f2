"""Words on pictures."""

from __future__ import annotations

import pytest

from reflectance_fit.plot.text import label, printable, slugs, with_error


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (55.93, 0.31, "55.9 ± 0.3"),
        (1.51853, 0.0011, "1.5185 ± 0.0011"),
        (1234.0, 20.0, "1234 ± 20"),
        (0.5, 0.0, "0.5"),
        (3.0, 0.096, "3.00 ± 0.10"),
        (-0.01, 0.3, "0.0 ± 0.3"),
        (-2.0, 0.3, "−2.0 ± 0.3"),
        (3.1e-7, 2e-8, "3.1e−07 ± 2e−08"),
    ],
)
def test_digits_follow_the_error(value, sd, text):
    assert with_error(value, sd) == text


def test_outside_text_is_made_harmless():
    assert printable("a\u202eb\nc") == "a\\u202eb\\nc"
    assert printable("日") == "\N{REPLACEMENT CHARACTER}"
    assert printable("__hidden") == "hidden"
    assert len(printable("x" * 500)) == 48


def test_slugs_are_plain_short_and_distinct():
    names = ["450 nm", "450nm", "632.8 nm", "../../etc", "", "R", "r", "<b>", "$", "z" * 99]
    result = slugs(names)
    assert result[:4] == ["450nm", "450nm-2", "632.8nm", "etc"]
    assert len({s.lower() for s in result}) == len(names)
    assert all(s.strip("-.") and len(s) <= 44 for s in result)


def test_labels_are_for_people():
    assert label("eta") == "η"
    assert label("angle_offset_deg") == "angle offset (deg)"
    assert label("sigma[psi_deg]") == "σ of psi (deg)"
