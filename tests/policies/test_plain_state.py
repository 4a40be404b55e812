import copy
import dataclasses
import enum
import io
import json
import random
from collections import Counter, OrderedDict, defaultdict, deque
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from upright.core.compiled import compiled
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.policies.own_classes import make_object
from upright.policies.plain_state import (
    DEPTH,
    LISTED,
    PlainState,
    decode_state,
    describe_state,
    encode_state,
)


class Keeper:
    """An agent that keeps whatever it is given."""

    def __init__(self, **kept: Any) -> None:
        vars(self).update(kept)

    def act(self, observation, rng): ...


class Step(NamedTuple):
    seen: State
    right: bool


@dataclasses.dataclass(frozen=True)
class Episode:
    steps: list[Step]
    total: float = 0.0


class Mode(enum.Enum):
    EXPLORE = 1
    GREEDY = "greedy"


class Layer:
    def __init__(self, weights):
        self.weights, self.unit = weights, np.tanh


class Slotted:
    __slots__ = ("__hidden", "lacking", "shown")

    def __init__(self, hidden, shown):
        self.__hidden, self.shown = hidden, shown

    @property
    def hidden(self):
        return self.__hidden


class Kernel(NamedTuple):
    weights: np.ndarray
    scale: float

    @compiled
    def act(self, observation, rng):
        return self.weights[3] > self.scale


class Table(dict):
    pass


class Generator(random.Random):
    pass


def double(x):
    return 2 * x


def through_json(state):
    """Return a state as it comes back from a file."""
    arrays = []
    for array in state.arrays:
        written = io.BytesIO()
        np.save(written, array, allow_pickle=False)
        arrays.append(np.load(io.BytesIO(written.getvalue()), allow_pickle=False))
    return PlainState(json.loads(json.dumps(state.data, allow_nan=False)), arrays)


def restored(agent, fresh):
    return decode_state(through_json(encode_state("mine:agent", agent, fresh)), fresh)


def again(value, new=None):
    """Return a value that an agent keeps, read back; `new` is what a new agent has there."""
    return restored(Keeper(it=value), Keeper(it=new)).it


def spelled(value):
    """Return a value with the types of all parts, so that only what is truly equal is equal."""
    kind = type(value)
    if kind is np.ndarray:
        by_columns = value.flags.f_contiguous and not value.flags.c_contiguous
        return kind, value.dtype.str, value.shape, by_columns, value.tobytes()
    if isinstance(value, np.generic):
        return kind, np.isnan(value) if value.dtype.kind in "fc" else False, repr(value)
    if isinstance(value, dict):
        factory = getattr(value, "default_factory", None)
        return kind, factory, [(spelled(key), spelled(value[key])) for key in value]
    if isinstance(value, (set, frozenset)):
        return kind, sorted(repr(spelled(part)) for part in value)
    if isinstance(value, (list, tuple, deque)):
        return kind, getattr(value, "maxlen", None), [spelled(part) for part in value]
    return kind, repr(value)


# ------------------------------------------------------------------------------ what is kept

LETTERS = st.text(max_size=5) | st.characters(categories=["Cs"])
NUMBERS = (
    st.integers()
    | st.floats()
    | st.complex_numbers()
    | st.floats(width=32).map(np.float32)
    | st.integers(-128, 127).map(np.int8)
    | st.complex_numbers(width=64).map(np.complex64)
    | st.integers(0, 2**64 - 1).map(np.uint64)
    | st.integers(2**300, 2**400)
)
KEYS = st.recursive(
    st.none() | st.booleans() | st.booleans().map(np.bool_) | LETTERS | st.binary() | NUMBERS,
    lambda inner: st.tuples(inner, inner) | st.frozensets(inner, max_size=2) | st.tuples(),
    max_leaves=4,
)
KINDS = "?bhilBHILefdFD"
ARRAYS = st_numpy.arrays(
    st.sampled_from(KINDS).map(np.dtype) | st.sampled_from([">f8", ">i2", "<U3", "S2"]),
    st_numpy.array_shapes(min_dims=0, min_side=0, max_side=3),
).flatmap(lambda array: st.sampled_from([array, np.asfortranarray(array)]))
PLAIN = st.recursive(
    KEYS | ARRAYS | st.builds(range, st.integers(), st.integers()),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner)
        | st.dictionaries(KEYS, inner, max_size=3)
        | st.dictionaries(KEYS, inner, max_size=3).map(OrderedDict)
        | st.dictionaries(KEYS, inner, max_size=3).map(lambda values: defaultdict(list, values))
        | st.dictionaries(KEYS, st.integers(), max_size=3).map(Counter)
        | st.sets(KEYS, max_size=3)
        | st.builds(deque, st.lists(inner, max_size=3), st.none() | st.integers(3, 2**40))
    ),
    max_leaves=12,
)


@settings(max_examples=300)
@given(PLAIN)
def test_plain_data_come_back_exactly(value):
    assert spelled(again(value)) == spelled(value)


def test_signs_and_orders_come_back():
    assert str(again([-0.0, 0.0])) == "[-0.0, 0.0]"
    assert list(again({"b": 1, "a": 2, 3: {}})) == ["b", "a", 3]
    assert again((1, (2,), [3])) == (1, (2,), [3])
    table = again({(1, -2): [0.5, 0.25], (True, 2.0): [0.0]})
    assert table[1, -2] == [0.5, 0.25]


def test_an_array_that_is_kept_twice_stays_one():
    best = np.arange(3.0)
    agent = restored(Keeper(best=best, tried=best, old=best.copy()), Keeper())
    assert agent.best is agent.tried is not agent.old
    agent.tried[0] = 7.0  # it is not read-only
    state = encode_state("mine:agent", Keeper(best=best, tried=best), Keeper())
    assert len(state.arrays) == 1


def test_a_list_that_is_kept_twice_becomes_two():
    shared = [1, 2]
    agent = restored(Keeper(one=shared, other=shared), Keeper())
    assert agent.one == agent.other
    assert agent.one is not agent.other


@pytest.mark.parametrize("function", [lambda: [0.0, 0.0], Counter, float])
def test_a_table_with_defaults_keeps_the_function_of_the_new_agent(function):
    learned = defaultdict(lambda: None, {(1, 2): [1.0, 2.0]})
    table = again(learned, defaultdict(function))
    assert table == learned
    assert table.default_factory is function


def test_tables_within_tables_get_their_functions_too():
    new = defaultdict(lambda: defaultdict(lambda: 7))
    learned = copy.deepcopy(new)
    learned["here"]["left"] += 1
    table = again(learned, new)
    assert table["here"] == {"left": 8}
    assert table["here"]["right"] == table["there"]["left"] == 7
    assert again(defaultdict(list, {1: [2]}))[3] == []  # its function has a name


def test_generators_are_those_of_the_new_agent():
    mine, new = np.random.default_rng(1), np.random.default_rng(2)
    assert again(mine, new) is new
    assert isinstance(again({"rng": mine})["rng"], np.random.Generator)


def test_code_is_that_of_the_new_agent():
    for code in (double, np.tanh, len, Keeper, json, compiled):
        assert again([code], [code]) == [code]
    with pytest.raises(UprightError, match=r"'it' is of type 'function', which is not data"):
        again(double, np.tanh)


# ------------------------------------------------------------------------------ objects


def test_objects_of_the_agents_module_are_filled_in():
    layers = [Layer(np.ones((2, 3))), Layer(np.full(2, np.nan))]
    new = [Layer(np.zeros((2, 3))), Layer(np.zeros(2))]
    read = again(layers, new)
    for one, other in zip(read, layers, strict=True):
        assert type(one) is Layer
        np.testing.assert_array_equal(one.weights, other.weights)
        assert one.unit is np.tanh
    assert not new[0].weights.any()


def test_objects_that_are_one_in_a_new_agent_may_have_parted():
    new = Layer(1)
    agent = restored(Keeper(net=Layer(2), target=Layer(3)), Keeper(net=new, target=new))
    assert (agent.net.weights, agent.target.weights) == (2, 3)


def test_records_of_the_agents_module_may_stand_anywhere():
    step = Step(State(1.0, 2.0, 3.0, 4.0), True)
    kept = deque([step, Episode([step], 0.5), Mode.GREEDY, {Mode.EXPLORE: Mode.GREEDY}], 9)
    read = again(kept)
    assert read == kept
    assert type(read[0].seen) is State
    assert read[2] is Mode.GREEDY
    assert again(Mode.EXPLORE, Mode.GREEDY) is Mode.EXPLORE
    assert again(Parameters(gravity=1.0), Parameters()).gravity == 1.0  # the package's own


def test_attributes_in_slots_are_kept():
    read = again(Slotted([1], 2), Slotted(None, None))
    assert (read.hidden, read.shown) == ([1], 2)
    assert not hasattr(read, "lacking")


def test_tables_of_the_class_are_part_of_the_state():
    class Shared(Keeper):
        values: dict[int, float] = {}  # noqa: RUF012 - as students write it

    learned = Shared(steps=1)
    learned.values[3] = 0.5
    state = through_json(encode_state("mine:agent", learned, Shared()))
    Shared.values.clear()  # as in another process
    read = decode_state(state, Shared())
    assert read.values == {3: 0.5}
    assert Shared.values == {}


def test_attributes_that_a_new_agent_lacks_are_set():
    assert vars(restored(Keeper(trace=[1]), Keeper())) == {"trace": [1]}


def test_the_agent_may_be_a_tuple():
    agent = restored(Step(State(1, 2, 3, 4), [5]), Step(None, None))
    assert agent == Step(State(1, 2, 3, 4), [5])
    assert type(agent) is Step


def test_the_new_agent_is_not_changed():
    fresh = Keeper(layers=[Layer([0])], table=defaultdict(int))
    restored(Keeper(layers=[Layer([1])], table=defaultdict(int, {1: 2})), fresh)
    assert fresh.layers[0].weights == [0]
    assert fresh.table == {}


# ------------------------------------------------------------------------------ what is refused


def within_itself():
    one = {"a": []}
    one["a"].append(one)
    return one


def deep(levels):
    inner = []
    for _ in range(levels - 1):
        inner = [inner]
    return inner


NOT_DATA = {
    "lambda": (lambda: {"f": lambda x: x}, r"\"it\['f'\]\" is of type 'function'"),
    "function": (lambda: double, "'it' is of type 'function', which is not data; a policy holds"),
    "method": (lambda: Keeper().act, "'it' is of type 'method'"),
    "module": (lambda: json, "'it' is of type 'module'"),
    "class": (lambda: [1, Keeper], r"'it\[1\]' is of type 'type'"),
    "file": (lambda: io.StringIO(), "of type 'StringIO'"),
    "iterator": (lambda: iter([1]), "of type 'list_iterator'"),
    "objects": (lambda: np.array([None, 1]), "'it' is an array of object, which is not plain"),
    "records": (lambda: np.zeros(2, [("x", "f8")]), r"is an array of \[\('x', '<f8'\)\]"),
    "dates": (lambda: np.array(["2020-01-01"], "M8[D]"), r"is an array of datetime64\[D\]"),
    "date": (lambda: np.datetime64("2020-01-01"), "of type 'datetime64'"),
    "matrix": (lambda: np.ma.array([1, 2]), "of type 'MaskedArray'"),
    "own dictionary": (lambda: Table(a=1), "of type 'Table'"),
    "hidden state": (lambda: Generator(), "of type 'Generator'"),
    "random": (lambda: random.Random(0), "of type 'Random'"),
    "seed": (lambda: np.random.SeedSequence(0), "of type 'SeedSequence'"),
    "library's": (lambda: [Parameters, UprightError("x")][1], "of type 'UprightError'"),
    "place": (
        lambda: Layer(1),
        "'it' is of type 'Layer', and a new agent has none in its place: create it in __init__",
    ),
    "layers": (lambda: {"net": [Layer(1)]}, r"\"it\['net'\]\[0\]\" is of type 'Layer'"),
    "compiled": (lambda: Kernel(np.zeros(4), 1.0), "'it' is of type 'Kernel'"),
    "local": (lambda: dataclasses.make_dataclass("Local", [])(), "is of type 'Local'"),
    "defaults": (lambda: [defaultdict(lambda: 0)], r"'it\[0\]' is a defaultdict, and a new agent"),
    "large": (lambda: 10**5000, "'it' is a number of more than 13,000 bits"),
    "cycle": (within_itself, r"\"it\['a'\]\[0\]\" is 'it' again, which contains it"),
    "deep": (lambda: deep(DEPTH + 1), f"is nested more than {DEPTH} deep"),
    "long key": (lambda: {"k" * 10_000: print}, r"attribute \"it\['k{1,20}\.\.\."),
}


@pytest.mark.parametrize(("make", "said"), NOT_DATA.values(), ids=NOT_DATA)
def test_what_is_not_data_is_refused_by_its_name(make, said):
    with pytest.raises(UprightError, match=rf"agent is 'mine:agent'; .* cannot be saved: .*{said}"):
        again(make())


def test_what_is_as_deep_as_allowed_is_kept():
    assert again(deep(DEPTH)) == deep(DEPTH)


def test_an_agent_that_keeps_itself_is_refused():
    agent = Keeper()
    agent.helper = Layer(agent)
    with pytest.raises(UprightError, match=r"'helper.weights' is the agent itself again"):
        encode_state("mine:agent", agent, Keeper(helper=Layer(None)))


def test_an_agent_that_is_a_container_is_refused():
    with pytest.raises(UprightError, match=r"cannot be saved: it is of type 'Table'"):
        encode_state("mine:agent", Table(), Table())


def test_an_agent_that_has_lost_an_attribute_is_refused():
    with pytest.raises(UprightError, match=r"cannot be saved: its state lacks .*'gamma'"):
        encode_state("mine:agent", Keeper(), Keeper(gamma=0.9))


# ------------------------------------------------------------------------------ bad data

BAD_DATA = {
    "unknown": ({"pickle": "x"}, "'it' is stated as {'pickle': 'x'}"),
    "empty": ({}, "stated as {}"),
    "more": ({"tuple": [], "more": 1}, "stated as"),
    "less": ({"deque": []}, "stated as"),
    "no list": ({"tuple": "abc"}, "stated with 'abc'"),
    "no pairs": ({"dict": [[1, 2, 3]]}, "entries are not pairs"),
    "half a pair": ({"dict": [1]}, "stated with 1"),
    "no key": ({"dict": [[[], 1]]}, "unhashable"),
    "no member of a set": ({"set": [{"dict": []}]}, "unhashable"),
    "no array": ({"array": 1}, "array 1, which is not in the file"),
    "no array's number": ({"array": "0"}, "stated with '0'"),
    "negative array": ({"array": -1}, "array -1"),
    "no bytes": ({"bytes": "xy"}, "non-hexadecimal"),
    "no float": ({"float": [1]}, "stated with"),
    "words": ({"float": "one"}, "could not convert"),
    "no complex": ({"complex": ["a"]}, "complex"),
    "no range": ({"range": [0, 1, 0]}, "must not be zero"),
    "long range": ({"range": [1, 2, 3, 4]}, "range expected"),
    "list for a scalar": ({"float64": [1, 2]}, "stated with"),
    "text for a scalar": ({"int8": "x"}, "invalid literal"),
    "large scalar": ({"int8": 1000}, "out of bounds"),
    "length": ({"deque": [], "maxlen": "x"}, "integer"),
    "factory": ({"defaultdict": [], "factory": "eval"}, "a defaultdict, and the new agent"),
    "factory's type": ({"defaultdict": [], "factory": []}, "stated with"),
    "code": ({"left out": "os.system"}, "code, and the new agent has none in its place"),
    "member": ({"Enum": "Mode", "member": "NONE"}, "'NONE' of 'Mode'"),
    "members": ({"Enum": "Mode", "member": []}, "unhashable"),
    "no enumeration": ({"Enum": "Keeper", "member": "x"}, "'x' of 'Keeper'"),
    "object": ({"object": "Keeper", "attributes": {}}, "of type 'Keeper', and the new agent has"),
    "function": ({"object": "double", "attributes": {}}, "of type 'double'"),
    "imported": ({"object": "UprightError", "attributes": {}}, "of type 'UprightError'"),
    "class's path": ({"object": "os.path", "attributes": {}}, "of type 'os.path'"),
    "class's type": ({"object": ["Keeper"], "attributes": {}}, "stated with"),
    "compiled": ({"NamedTuple": "Kernel", "fields": {}}, "of type 'Kernel'"),
    "tuple as object": ({"object": "Step", "attributes": {}}, "type 'Step', which has other"),
    "enum as object": ({"object": "Mode", "attributes": {}}, "type 'Mode', which has other"),
    "object as tuple": ({"NamedTuple": "Episode", "fields": {}}, "'Episode', which is none"),
    "fields": ({"NamedTuple": "Step", "fields": {"seen": 1}}, "'Step' with other fields"),
    "dataclass": ({"object": "Episode", "attributes": {"total": 1}}, "lacks .*'it.steps'"),
    "attributes": ({"object": "Episode", "attributes": [1]}, "stated with"),
    "deep": (deep(DEPTH + 10), "nested more than"),
    "deep elsewhere": ({"tuple": deep(300)}, "nested more than"),
}


def keeper_with(data, **more):
    return {"object": "Keeper", "attributes": {"it": data, **more}}


@pytest.mark.parametrize(("data", "said"), BAD_DATA.values(), ids=BAD_DATA)
def test_bad_data_are_refused(data, said):
    state = PlainState(keeper_with(data), [np.zeros(1)])
    with pytest.raises((ValueError, TypeError, OverflowError), match=said):
        decode_state(state, Keeper())


@pytest.mark.parametrize("data", [[], 1, None, {"dict": []}, {"object": "Layer", "attributes": {}}])
def test_a_state_must_be_that_of_the_agent(data):
    read = None
    with pytest.raises(
        ValueError, match=r"in its state, it is of type 'Layer'|no state of an agent"
    ):
        read = decode_state(PlainState(data, []), Keeper())
    assert read is None


def test_no_method_can_be_hidden():
    with pytest.raises(ValueError, match="Keeper can have no attribute 'act' that is data"):
        decode_state(PlainState(keeper_with(1, act=1), []), Keeper())
    with pytest.raises(ValueError, match="'__deepcopy__'"):
        decode_state(PlainState(keeper_with(1, __deepcopy__=1), []), Keeper())
    with pytest.raises(ValueError, match="Slotted can have no attribute 'more'"):
        make_object(Slotted, {"more": 1})


def test_a_property_is_not_called():
    class Trap(Keeper):
        @property
        def it(self): ...

        @it.setter
        def it(self, value):
            raise AssertionError("code was run")

    data = {"object": "Trap", "attributes": {"it": 1}}
    assert vars(decode_state(PlainState(data, []), Trap())) == {"it": 1}


@pytest.mark.parametrize(
    "fields", [{"weights": {"array": 0}, "scale": 1.0}, {"weights": {"array": 1}, "scale": 1}]
)
def test_what_is_compiled_must_keep_its_form(fields):
    new = Keeper(it=Kernel(np.zeros(4), 1.0))
    good = {"NamedTuple": "Kernel", "fields": {"weights": {"array": 1}, "scale": 2.0}}
    arrays = [np.zeros(3), np.ones(4)]
    assert decode_state(PlainState(keeper_with(good), arrays), new).it.scale == 2.0
    bad = {"NamedTuple": "Kernel", "fields": fields}
    with pytest.raises(ValueError, match="of another form than in a new agent"):
        decode_state(PlainState(keeper_with(bad), arrays), new)


def test_an_attribute_that_was_added_to_the_code_is_named():
    state = encode_state("mine:agent", Keeper(net=Layer(1)), Keeper(net=Layer(0)))
    with pytest.raises(ValueError, match=r"'gamma', which the agent has .* code changed since\?"):
        decode_state(state, Keeper(net=Layer(0), gamma=0.9))
    more = Layer(0)
    more.bias = 1
    with pytest.raises(ValueError, match=r"'net\.bias'"):
        decode_state(state, Keeper(net=more))


# ------------------------------------------------------------------------------ description


def test_a_state_is_described_in_a_few_words():
    agent = Keeper(
        table=defaultdict(list, {1: [], 2: []}),
        weights=np.zeros((2, 3)),
        steps=12,
        name="x" * 1000,
        rng=np.random.default_rng(0),
        net=Layer(0),
    )
    described = describe_state(agent)
    assert described.pop("name") == f"'{'x' * 12}...{'x' * 13}'"
    assert described == {
        "table": "defaultdict of 2",
        "weights": "array of float64, shape (2, 3)",
        "steps": "12",
        "rng": "Generator",
        "net": "Layer",
    }
    many = describe_state(Keeper(**{f"a{i}": i for i in range(LISTED + 5)}))
    assert len(many) == LISTED + 1
    assert many["…"] == "5 more"
