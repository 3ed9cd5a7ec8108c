"""Functions compiled with their callees inside: what is kept on disk is not that of other callees."""

import pytest

from hrg_cli.physics.compilation import bound, compile_all, fingerprint

STEP = 1.0


def inner(x):
    return x + STEP


def outer(x):
    return 2 * inner(x)


def test_the_fingerprint_follows_code_and_numbers_of_every_part():
    def inner_other(x):
        return x - STEP

    plain = fingerprint([inner, outer])
    assert fingerprint([inner, outer]) == plain
    assert fingerprint([inner_other, outer]) != plain
    assert fingerprint([bound(inner, STEP=2.0), outer]) != plain


def test_the_fingerprint_follows_the_kinds_of_arguments():
    """A class that had been renamed was looked for by its old name in what was kept on disk."""

    def taking(kind):
        def inner(x):
            return x + STEP

        inner.__annotations__["x"] = kind
        return inner

    class Renamed(tuple):
        pass

    assert fingerprint([taking(tuple)]) == fingerprint([taking(tuple)])
    assert fingerprint([taking(Renamed)]) != fingerprint([taking(tuple)])


@pytest.mark.parametrize("opened", [(), ("inner",)])
def test_a_compiled_function_calls_what_is_given_for_a_name(opened):
    njit = pytest.importorskip("numba").njit
    by_two = compile_all(njit, [bound(inner, STEP=2.0), outer], opened=opened)["outer"]
    assert (compile_all(njit, [inner, outer], opened=opened)["outer"](1.0), by_two(1.0)) == (4, 6)
