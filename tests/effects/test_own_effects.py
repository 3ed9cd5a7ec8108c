"""Effects that a user brings in a file: taken when they work, refused by name and in words when
they do not."""

import pytest

from hrg_cli.effects import load_effects
from hrg_cli.errors import HrgError

HEAD = "import numpy as np\nfrom hrg_cli.effects import Effect, Parameter\n"
MADE = (
    HEAD
    + "OWN = Effect(name='{name}', family='user', page='', parameters=({parameters}), slow=lambda"
    " p, u, s: {slow})\n"
)
ONE = "Parameter('a', 's', 1e-3, 'size'),"


def written(folder, text):
    path = folder / "own.py"
    path.write_text(text)
    return path


def test_a_working_effect_is_taken(tmp_path):
    text = MADE.format(
        name="windage", parameters=ONE, slow="-p['a'] * (s.rate_rad_s**2)[..., None] * u"
    )
    (effect,) = load_effects(written(tmp_path, text))
    assert effect.name == "windage" and effect.fitted()[0].name == "a"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("raise ValueError('x')", "fails to run"),
        ("x = 1", "holds no Effect"),
        (
            MADE.format(name="gain_mismatch", parameters=ONE, slow="0 * u"),
            "of the catalogue already",
        ),
        (MADE.format(name="empty", parameters="", slow="0 * u"), "no parameter"),
        (
            MADE.format(name="broken", parameters=ONE, slow="1 / 0 * u"),
            r"broken fail \(ZeroDivisionError",
        ),
        (MADE.format(name="flat", parameters=ONE, slow="u[..., 0]"), "shape"),
        (MADE.format(name="mad", parameters=ONE, slow="np.nan * u"), "not finite"),
    ],
)
def test_a_broken_effect_is_refused_in_words(tmp_path, text, says):
    with pytest.raises(HrgError, match=says):
        load_effects(written(tmp_path, text))
