from hypothesis import given
from hypothesis import strategies as st

from nbv.errors import by_number, nearest


@given(st.permutations([1, 2, 10, 19, 100]), st.sampled_from(["", "obj_"]))
def test_names_with_numbers_are_in_order_and_never_close(numbers, prefix):
    names = [f"{prefix}{number}" for number in numbers]
    assert sorted(names, key=by_number) == [f"{prefix}{number}" for number in sorted(numbers)]
    assert nearest("11", map(str, numbers)) == "choose from: 1, 2, 10, 19, 100"
    assert nearest("mgu", ["mug", "cup"]) == "did you mean 'mug'?"
