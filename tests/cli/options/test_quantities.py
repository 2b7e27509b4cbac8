from __future__ import annotations

from contextlib import suppress

import click
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from deepmuon_cli.options import quantities

READERS = [getattr(quantities, name) for name in quantities.__all__]
LIKE_A_QUANTITY = r"[+-]?[0-9.,_]{1,8}([eE][0-9]{1,4})? ?[a-zA-Z0-9^\u00b2.]{0,6}"
TEXTS = st.text(max_size=12) | st.from_regex(LIKE_A_QUANTITY, fullmatch=True)


@settings(deadline=None)
@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
@given(text=TEXTS)
@example("1e999M")
@example("1__0k")
@example("1e400,5h")
def test_any_text_is_a_quantity_or_is_refused_in_words(read, text):
    with suppress(click.BadParameter):
        read(text)
