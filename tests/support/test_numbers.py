import pytest

from upright.errors import UprightError
from upright.support.numbers import whole_number
from upright.support.words import count


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("0", 0),
        (" 7 ", 7),
        ("-1", -1),
        ("+5", 5),
        ("007", 7),
        ("60000", 60_000),
        ("60,000", 60_000),
        ("1,234,567", 1_234_567),
        ("60_000", 60_000),
        ("1e5", 100_000),
        ("6E+4", 60_000),
        ("1.5e3", 1_500),
        ("600k", 600_000),
        ("1.5K", 1_500),
        ("2M", 2_000_000),
        ("9223372036854775807", 2**63 - 1),
        ("9,223,372,036,854,775,807", 2**63 - 1),
        ("9.223372036854775807e18", 2**63 - 1),
    ],
)
def test_a_whole_number_is_read_as_people_write_it(text, number):
    assert whole_number(text) == number
    assert type(whole_number(text)) is int


@pytest.mark.parametrize(
    "text",
    [
        *("", "-", "many", "1.5", "60.000", "60.000,5", "1,5", "60,00", "6,0000", ",000", "0x10"),
        *("1_0", "1__000", "1,000_000", "1e-3", "1.55e1", "1e", "1e400", "1e999999999", "1m", "k"),
        *("1 000", "٣", "1²", "nan", "inf", "9" * 5_000, "1e5k", "1,000k", "--1"),
    ],
)
def test_what_is_none_or_may_be_two_is_refused(text):
    with pytest.raises(UprightError, match="must be a whole number, written like 60000, 60,000"):
        whole_number(text)


def test_a_comma_may_be_between_values_instead():
    assert whole_number("1_000", commas=False) == 1_000
    with pytest.raises(UprightError, match="like 60000, 60_000, 6e4 or 60k"):
        whole_number("1,000", commas=False)


def test_one_thing_has_no_s():
    numbers = [count(number, "run") for number in (0, 1, 2, 60_000)]
    assert numbers == ["0 runs", "1 run", "2 runs", "60,000 runs"]
