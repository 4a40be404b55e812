from upright.support.words import count


def test_one_thing_has_no_s():
    assert [count(n, "run") for n in (0, 1, 1200)] == ["0 runs", "1 run", "1,200 runs"]
