"""Settings: signature < file < --set < flags; every wrong key is named, nothing strange passes."""

import os
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from hrg_cli import settings
from hrg_cli.errors import HrgError, UsageError


def smooth(
    record,
    *,
    width: Annotated[float, Field(gt=0, description="width")] = 1.0,
    kind: Literal["a", "b"] = "a",
    repeats: int = 3,
) -> None:
    """A stage for these tests."""


def test_order_of_precedence(tmp_path):
    file = tmp_path / "c.toml"
    file.write_text("[smooth]\nwidth = 2.0\nkind = 'b'\n[other]\nx = 1\n")
    assert settings.resolve(smooth) == {"width": 1.0, "kind": "a", "repeats": 3}
    assert settings.resolve(smooth, file)["width"] == 2.0
    assert settings.resolve(smooth, file, ("width=3",))["width"] == 3.0
    assert settings.resolve(smooth, file, ("smooth.width=3",), {"width": 4.0, "kind": None}) == {
        "width": 4.0,
        "kind": "b",
        "repeats": 3,
    }


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[smooth]\nwidht = 2.0", "did you mean width"),
        ("[smooth]\nwidth = -2.0", "greater than 0"),
        ("[smooth]\nwidth = nan", "finite"),
        ("[smooth]\nwidth = 'wide'", "width"),
        ("[smooth]\nkind = 'c'", "kind"),
        ("smooth = 3", "not a table"),
        ("[smooth", "not TOML"),
        ("a = " + "[" * 5000, "not TOML"),
    ],
)
def test_wrong_files_are_refused_in_words(text, says, tmp_path):
    file = tmp_path / "c.toml"
    file.write_text(text)
    with pytest.raises(HrgError, match=says) as caught:
        settings.resolve(smooth, file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("keys", ["k{} = 1\n", "[t{}]\n", "a.b{}.c.d = 1\n", "{}a = [{{}}]\n"])
def test_a_file_of_too_many_keys_is_refused_before_it_is_parsed(keys, tmp_path, monkeypatch):
    """300 000 keys took ten seconds and 585 MB, to be told one by one."""
    file = tmp_path / "c.toml"
    file.write_text("".join(keys.format(k) for k in range(settings.MOST_KEYS + 1)))
    monkeypatch.setattr(settings.tomllib, "loads", lambda text: pytest.fail("it was parsed"))
    with pytest.raises(HrgError, match="keys, tables and lists") as caught:
        settings.load_toml(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("name", ["a", "a-1 ", '"b c"', "'.'"])
@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "x = {{ {} = 1 }}"])
def test_a_key_of_too_many_names_is_refused_before_it_is_parsed(form, name, tmp_path, monkeypatch):
    """A key of 40 000 names took 3 GB and the process's end for want of memory."""
    file = tmp_path / "c.toml"
    file.write_text(form.format(".".join([name] * settings.MOST_NAMES)))
    assert settings.load_toml(file)
    file.write_text(form.format(".".join([name] * (settings.MOST_NAMES + 1))))
    monkeypatch.setattr(settings.tomllib, "loads", lambda text: pytest.fail("it was parsed"))
    with pytest.raises(HrgError, match="more than 100 names by dots") as caught:
        settings.load_toml(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("what", ["pipe", "device"])
def test_what_has_no_end_is_no_settings_file(what, tmp_path, monkeypatch):
    """A pipe that nobody wrote was waited for without end; the zeros of a device took all
    memory."""
    file = tmp_path / "c.toml"
    if what == "pipe":
        os.mkfifo(file)
    else:
        file.symlink_to(os.devnull)
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(HrgError, match="is a device, pipe or socket; name a TOML file"):
        settings.load_toml(file)


def test_a_sentence_names_some_wrong_keys_and_counts_the_others():
    values = {f"unknown{k}": k for k in range(settings.MOST_TOLD + 5)}
    with pytest.raises(HrgError, match=rf"unknown{settings.MOST_TOLD - 1}; and 5 more$"):
        settings.check_settings(smooth, values)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("width", "--set width: key=value was expected"),
        ("=3", "--set =3: key=value was expected"),
        ("width=-1", "width = '-1': input should be greater than 0"),
        ("other=1", "unknown key other"),
        ("width.x=1", "width: input should be a valid number"),
    ],
)
def test_wrong_assignments_are_usage_errors(text, says):
    with pytest.raises(UsageError, match=says):
        settings.resolve(smooth, None, (text,))


def test_not_utf8_and_missing(tmp_path):
    (tmp_path / "c.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(HrgError, match="not a text file"):
        settings.resolve(smooth, tmp_path / "c.toml")
    with pytest.raises(HrgError, match="no such file"):
        settings.resolve(smooth, tmp_path / "d.toml")


tables = st.recursive(
    st.one_of(
        st.integers(-(2**60), 2**60),
        st.floats(allow_nan=False, allow_infinity=False),
        st.text(max_size=20),
        st.booleans(),
    ),
    lambda children: st.one_of(
        st.lists(children, max_size=3),
        st.dictionaries(st.text(min_size=1, max_size=8), children, max_size=3),
    ),
    max_leaves=8,
)


@given(st.dictionaries(st.text(min_size=1, max_size=8), tables, max_size=4))
def test_toml_round_trip(tree):
    import tomllib

    assert tomllib.loads(settings.to_toml(tree)) == tree
