"""The rows that models share: each takes what it has, in an order that does not depend on it."""

import pytest

from damped_pendulum.interface import VARIABLES
from fmi.rows import TYPES, UNITS, types_of, units_of
from fmi.tables import Type, Unit, Variable

PLAIN = Variable("p", "Mass", "parameter", "A mass", 1.0)
OWN = Variable("q", "Flux", "parameter", "A flux", 1.0)


def test_every_unit_of_a_type_is_there_and_no_name_twice() -> None:
    assert {type_.unit for type_ in TYPES} <= {unit.name for unit in UNITS}
    for rows in (TYPES, UNITS):
        assert len({row.name for row in rows}) == len(rows)


def test_a_model_has_the_types_and_units_of_its_variables_and_no_others() -> None:
    flux, weber = Type("Flux", "Wb"), Unit("Wb", {"kg": 1, "m": 2, "s": -2, "A": -1})
    types = types_of([OWN, PLAIN, *VARIABLES[-1:]], flux, Type("Other", "kg"))
    assert types == (Type("Mass", "kg"), flux)
    assert units_of(types, weber) == (Unit("kg", {"kg": 1}), weber)


def test_a_type_that_is_in_no_table_is_refused_by_name() -> None:
    with pytest.raises(
        ValueError, match=r"^q has the type Flux, which is none of fmi/rows\.py or of the model$"
    ):
        types_of([PLAIN, OWN])


def test_a_unit_that_is_in_no_table_is_refused_by_name() -> None:
    with pytest.raises(
        ValueError, match=r"^Flux has the unit Wb, which is none of fmi/rows\.py or of the model$"
    ):
        units_of([Type("Mass", "kg"), Type("Flux", "Wb")])
