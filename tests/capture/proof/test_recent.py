"""Results are kept as long as they are of the same objects, and only a few of them."""

from dsl_core.capture.proof.recent import KEPT, Recent


def test_a_result_is_worked_out_once_for_the_same_objects() -> None:
    kept, made = Recent[int](), []

    def work() -> int:
        made.append(0)
        return len(made)

    one, other = [0], [0]
    assert [kept.get(3, (one,), work) for _ in range(2)] == [1, 1]
    assert kept.get(3, (other,), work) == 2, "equal, but not the same"
    assert kept.get(4, (other,), work) == 3
    for number in range(10, 10 + KEPT):
        kept.get(number, (), work)
    assert kept.get(3, (other,), work) == 4 + KEPT, "forgotten"
