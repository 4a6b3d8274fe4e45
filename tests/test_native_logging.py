"""What reaches the logger of a host, and when: names, cut texts, categories."""

from ctypes import byref, c_char_p
from typing import Any

import pytest
from fmpy.fmi2 import (
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2CoSimulation,
    fmi2ModelExchange,
)

from methods.solvers import SolverMethod
from tests.driver import OK, WARNING, Instance


def raw_instance(instance: Instance, logger: Any, name: str, kind: int, guid: str) -> Any:
    """Instantiate without FMPy's checks."""
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = logger
    return instance.slave.fmi2Instantiate(name.encode(), kind, guid.encode(), b"", byref(callbacks), 0, True)


@pytest.fixture
def log() -> tuple[list[bytes], Any]:
    """Return the messages of a logger, and the logger."""
    messages: list[bytes] = []
    logger = fmi2CallbackLoggerTYPE(lambda *arguments: messages.append(arguments[-1]))
    return messages, logger


@pytest.mark.parametrize(
    ("guid", "name", "words"),
    [
        ("{0}", "pendulum", "the GUID is {0} instead of "),
        (None, "", "the instance name is missing"),
        (None, " \t\n", "the instance name is missing"),
    ],
)
def test_a_wrong_instantiation_is_refused(
    instance: Instance, log: tuple[list[bytes], Any], guid: str | None, name: str, words: str
) -> None:
    messages, logger = log
    guid = guid or instance.fmu.description.guid
    assert raw_instance(instance, logger, name, fmi2CoSimulation, guid) is None
    assert words in messages[0].decode()


def test_a_model_exchange_instance_is_refused(instance: Instance, log: tuple[list[bytes], Any]) -> None:
    messages, logger = log
    assert raw_instance(instance, logger, "p", fmi2ModelExchange, instance.fmu.description.guid) is None
    assert messages == [b"p: the FMU is for co-simulation alone"]


def test_percent_and_number_signs_do_not_reach_a_logger_that_formats(
    instance: Instance, log: tuple[list[bytes], Any]
) -> None:
    messages, logger = log
    assert raw_instance(instance, logger, "50% of #r9#", fmi2CoSimulation, "#%s#") is None
    assert messages[0].startswith(b"50percent of ##r9##: the GUID is ##percents## instead of ")


@pytest.mark.parametrize(
    "text", ["a" + 300 * "\u00e4", 134 * "\u20ac", "ab" + 101 * "\U0001f600", 4000 * "%"]
)
def test_a_long_text_of_the_host_is_cut_between_characters(
    instance: Instance, log: tuple[list[bytes], Any], text: str
) -> None:
    messages, logger = log
    for name, guid in ((text, "x"), ("x", text), (text, text)):
        assert raw_instance(instance, logger, name, fmi2CoSimulation, guid) is None
        shown = messages.pop().decode()  # which UTF-8 that is cut would not let
        whole = text.encode()[:400].decode(errors="ignore").replace("%", "percent")
        assert (whole if name == text else "x") + ": the GUID is " in shown
        assert len(shown.encode()) < 4096


def test_a_message_that_does_not_fit_is_cut_between_characters(
    instance: Instance, log: tuple[list[bytes], Any]
) -> None:
    """Its 4095 bytes end within one of these names or the other."""
    messages, logger = log
    for first in range(1, 9):
        name, guid = 400 * "%", (first + 180) * "%" + 200 * "\u00e4"
        assert raw_instance(instance, logger, name, fmi2CoSimulation, guid) is None
        assert 4080 < len(messages.pop().decode().encode()) < 4096


def warned(instance: Instance) -> bool:
    """Return whether an unstable step size is logged; the status tells it always."""
    assert instance.reset() == OK
    instance.log.clear()
    assert instance.set("solver.method", SolverMethod.ExplicitEuler) == OK
    assert instance.call("fmi2EnterInitializationMode") == OK
    assert instance.call("fmi2ExitInitializationMode") == WARNING
    return bool(instance.log)


def debug_logging(instance: Instance, on: bool, *categories: str | None) -> int:
    n = len(categories)
    names = [None if category is None else category.encode() for category in categories]
    return instance.call("fmi2SetDebugLogging", on, n, (c_char_p * n)(*names))


def test_warnings_are_logged_but_where_their_category_is_switched_off(instance: Instance) -> None:
    assert warned(instance)
    for on, categories, expected in (
        (False, (), True),
        (True, (), True),
        (True, ("logStatusError",), False),
        (True, ("logStatusError", "logStatusWarning"), True),
        (True, ("logStatusDiscard",), False),
        (False, ("logStatusWarning",), False),
        (False, ("logStatusError",), True),
    ):
        assert debug_logging(instance, on, *categories) == OK
        assert warned(instance) == expected, (on, categories)  # after a reset
        instance.refusal(instance.step(0.0, -1.0))  # errors always are
    state = instance.save()
    assert debug_logging(instance, False, "logStatusWarning") == OK
    assert instance.restore(state) == OK
    assert not warned(instance)  # logging is no part of a state
    instance.free_state(state)


def test_wrong_log_categories_are_refused_and_change_nothing(instance: Instance) -> None:
    allowed = "(allowed: logStatusWarning, logStatusDiscard, logStatusError)"
    assert instance.refusal(debug_logging(instance, False, "logStatusError", "logAl")) == (
        f"pendulum: log category logAl is unknown {allowed}"
    )
    assert "an argument is NULL" in instance.refusal(debug_logging(instance, False, None))
    assert "an argument is NULL" in instance.refusal(instance.call("fmi2SetDebugLogging", 0, 1, None))
    assert warned(instance)
