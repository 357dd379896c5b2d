"""Wrong arguments of the names that are used first: each is refused, in words, before anything is computed."""

import inspect
import math
import pathlib
import re
import warnings
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.public_calls import AcceptedError, ideal, posterior
from helpers.wrong_values import CELL, WRONG
from tactile_bayes.checks import as_number, as_numbers, check_array, check_numbers, shown
from tactile_bayes.errors import ParameterError, TactileBayesError, TactileBayesWarning


def no_records():
    """Datasets that lack something, and other things of the kind."""
    return [
        xr.Dataset(),
        xr.Dataset({"force_x": ("time", [1.0, 2.0])}),
        ideal().drop_vars("drive_angle"),
        ideal().isel(sample=[]),
        ideal().isel(sample=0),
        ideal().drop_attrs(),
        ideal().assign(force_x=("sample", ["a"] * ideal().sizes["sample"])),
        ideal().assign_attrs(rod_length="long"),
        ideal().assign_attrs(units=None),
        ideal().to_dataframe(),
        ideal()["force_x"],
    ]


def no_posteriors():
    """Trees that lack something."""
    unnamed, other, empty, words = (posterior().copy() for _ in range(4))
    unnamed.attrs = {}
    other.attrs = {**posterior().attrs, "family": "circle"}
    for name in ("posterior", "events"):
        empty[name] = xr.DataTree(posterior()[name].to_dataset().isel(draw=[]))
    words["posterior"] = xr.DataTree(xr.Dataset({k: (("chain", "draw"), [["x"]]) for k in ("a", "q", "x_c")}))
    return [xr.DataTree(), xr.DataTree.from_dict({"posterior": xr.Dataset()}), unnamed, other, empty, words]


# --- What is wrong, for one argument or another ---------------------------------------------------------------------

# What a refusal calls arguments that it does not call by their names.
NAMED_BY = {
    **dict.fromkeys(("record", "measured"), "record|samples?|column|units|attribute"),
    **dict.fromkeys(("posterior", "without_events"), "posterior|draws|infer_contour"),
    **dict.fromkeys(("diameter", "youngs_modulus"), "diameter|youngs_modulus|flexural_rigidity"),
    "path": "path|record|folder",
    "families": "families|family",
    "unknown": "unknown|rig|prior",
    "r": "r|circle",
    "false_alarm": "false_alarm|record",
    "file": "file|columns|missing|split_sweeps",
}


@cache
def more_wrong():
    """Wrong values of one argument, of a function or of any, beside those that are wrong of most."""
    bases = [[(0, 0), (1,)], [0.0, None], "here", (0.0,), (0.0, 0.0, 0.0), [(0.0, math.nan)], (math.nan, 0)]
    return {
        "record": no_records(),
        "measured": no_records(),
        "reconstruct(measured)": [*no_records(), ideal().drop_vars("force_y")],
        "posterior": no_posteriors(),
        "predictive_interval(posterior)": [],
        "without_events": no_posteriors(),
        "probability": [0.0, 1.0, 90.0],
        "path": ["\0", "folder/\0.csv", pathlib.Path(), pathlib.Path("record.txt"), 3],
        "base": bases,
        "equilibria(base)": [*bases, [(0, 0), (1, 0)]],
        "drive_angles": [["1", "2"], [90.0, 180.0], [[]]],
        "drive_step": ["1", 1],
        "slope_angles": [[10.0], [[0.1]]],
        "equilibria(direction)": ["both"],
        "gain": [np.zeros((3, 3)), [[1, 2, 3]] * 3],
        "bias": [[0, 0, "1"], [0, 0]],
        "zero_load(false_alarm)": [0.5],
        "checkpoint": ["\0"],
        "unknown": [
            *({"friction": None}, {"friction": "wide"}, {"left": 0.1}, {"friction": stats.norm}, {1: 0.1}),
            "everything",
        ],
        "file": [{"force_x": None}, {"left": "Fx"}, {"missing": ["left"]}, {"split_sweeps": 1}],
        "Family(r)": [0.0, -1.0, stats.norm, stats.norm(0.1, 0.0)],
        "ensembles": [1, 2.0],
        "walkers": [2, 7],
        "max_r_hat": [1.0],
        "min_ess": [0.0],
        "max_seconds": [0.0],
        "families": [["parabola"], ["parabola", 1], ["parabola", "left"], ["circle"] * 2],
        "draws": [2, 10, 4.0, "4"],
        "infer_contacts(rng)": [-1],
    }


# --- What is right: of these a call may be accepted -----------------------------------------------------------------


def number(low=-math.inf, high=math.inf, *, or_infinite=False):
    """Numbers in [low, high]; to exclude an end, give the next number."""

    def is_right(value):
        if isinstance(value, bool | np.bool_ | complex) or not isinstance(value, int | float | np.number):
            return False
        return low <= value <= high and (or_infinite or abs(value) < 1e309)

    return is_right


def row(value):
    return np.ndim(value) < 2 and numbers(value)


def pair(value):
    return np.shape(value) == (2,) and numbers(value)


def numbers(value):
    """Numbers, or arrays of finite ones; an empty array is one of no contours."""
    if number()(value):
        return True
    is_array = isinstance(value, list | np.ndarray | xr.DataArray) and np.asarray(value).dtype.kind in "iuf"
    return (
        is_array and not (isinstance(value, list) and True in [v is True for v in value]) and np.isfinite(value).all()
    )


def whole(low, high=math.inf):
    return lambda value: type(value) is int and low <= value <= high


def kind(*of, **attributes):
    return lambda value: isinstance(value, of) and all(getattr(value, name) == v for name, v in attributes.items())


def either(*rights):
    return lambda value: any(right(value) for right in rights)


def one_of(*words):
    return lambda value: isinstance(value, str) and value in words


def empty(*kinds):
    return lambda value: isinstance(value, kinds) and not isinstance(value, xr.Dataset | xr.DataTree) and not len(value)


def frozen(value):
    """A distribution with a width."""
    return hasattr(value, "logpdf") and hasattr(value, "args") and value.std() > 0.0


def nothing(value):
    return value is None


def never(value):
    return False


TINY = math.ulp(0.0)
AT_LEAST_0, POSITIVE = number(0.0), number(TINY)
SHARE = number(TINY, math.nextafter(1.0, 0.0))
FLAG = kind(bool, np.bool_)

# By argument, of a function or of any; nothing else is right of those that are not named.
RIGHT = {
    "contour": kind(tb.contours.Circle, shape=()),
    **dict.fromkeys(("a", "b", "n", "q", "r", "x_c"), numbers),
    "base": pair,
    "rig": either(nothing, kind(tb.Rig)),
    "direction": one_of("both", "forward", "backward"),
    "equilibria(direction)": one_of("forward", "backward"),
    "drive": either(nothing, kind(tb.Rotation)),
    "drive_step": either(nothing, number(1e-6, 0.5)),
    "drive_angles": either(nothing, row),
    "slope_angles": row,
    "rng": either(whole(0), kind(np.random.Generator, np.random.SeedSequence)),
    "settings": either(nothing, kind(tb.SamplerSettings)),
    **dict.fromkeys(("progress", "keep"), either(nothing, callable)),
    "checkpoint": either(nothing, one_of("left", "0.1")),
    "method": one_of("raw", "constrained"),
    "prior": one_of("flat", "polar"),
    "draws": lambda value: whole(4, 10**6)(value) and value % 4 == 0,
    "x": lambda value: row(value) or empty(list)(value),
    "probability": SHARE,
    **dict.fromkeys(("simultaneous", "leave_one_out", "events"), FLAG),
    "without_events": nothing,
    "false_alarm": number(TINY, 0.499),
    "compare_families(false_alarm)": SHARE,
    # Load cells
    **{name: AT_LEAST_0 for name in vars(CELL) if name.endswith(("noise", "resolution"))},
    **dict.fromkeys(("force_range", "moment_range", "degrees_of_freedom"), number(TINY, or_infinite=True)),
    **dict.fromkeys(("drive_angle_offset", "drive_angle_backlash"), number()),
    **dict.fromkeys(("lever", "moment_curve"), pair),
    **dict.fromkeys(("lag", "lag_seconds", "play"), AT_LEAST_0),
    **dict.fromkeys(("drift", "frame", "calibration"), nothing),
    # Rods
    "length": number(0.1, 10.0),
    "flexural_rigidity": POSITIVE,
    "diameter": number(0.0, 0.1),
    "Rod.circular(diameter)": number(1e-3, 0.1),
    "youngs_modulus": number(1.0, 1e12),
    "elastic_strain": either(nothing, POSITIVE),
    "rest_curvature": number(),
    "taper": number(0.0, 1.0),
    **dict.fromkeys(("stem", "rest_curvature_deviation", "taper_deviation"), AT_LEAST_0),
    "rigidity_profile": either(nothing, POSITIVE),
    "rest_shape_modes": empty(list, np.ndarray),
    # Rigs and families
    "rod": either(nothing, kind(tb.Rod)),
    "load_cell": either(nothing, kind(tb.LoadCell)),
    "unknown": either(empty(dict), one_of("nothing")),
    "file": empty(dict),
    "Family(r)": either(POSITIVE, frozen),
    "Family(x_c)": either(number(), frozen),
    # Settings of samplers
    **dict.fromkeys(("block_steps", "max_steps"), whole(1, 10**9)),
    "ensembles": whole(2, 10**9),
    "walkers": nothing,
    "max_r_hat": number(1.1),
    "min_ess": POSITIVE,
    "max_seconds": either(nothing, POSITIVE),
}
NAMES = (
    "scan",
    "equilibria",
    *(f"LoadCell{method}" for method in ("", ".measure", ".from_record", ".from_zero_load")),
    "zero_load",
    "read_record",
    "write_record",
    "reconstruct",
    "infer_contour",
    "Rig",
    "Family",
    "SamplerSettings",
    "contour_band",
    "predictive_interval",
    "gap",
    *(f"contours.{family}" for family in ("Parabola", "Circle", "Ellipse", "PowerLaw")),
    "Rod",
    "Rod.circular",
    "compare_families",
    "infer_contacts",
)


def for_argument(table, name, argument, otherwise):
    """What a table says of an argument of this function, or else of any."""
    return table.get(f"{name}({argument})", table.get(argument, otherwise))


def refusal(call, **wrong):
    """The words in which a call is refused, if it is; another error than one of the package, or a foreign warning,
    fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TactileBayesWarning)
        try:
            call.function(**{**call.arguments, **wrong})
        except AcceptedError:
            return None
        except FileNotFoundError:  # as `read_record` says, of a path
            return "path"
        except TactileBayesError as error:
            said = str(error)
        else:
            return None
    assert 20 < len(said) < 600
    return said


@pytest.mark.usefixtures("before_sampling")
@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_argument_is_refused_in_words(name, every, calls):
    """Of what is wrong anywhere each argument is given every third, beside all that is wrong of it alone."""
    assert refusal(calls[name]) is None
    for number, argument in enumerate(calls[name].arguments):
        is_right = for_argument(RIGHT, name, argument, never)
        named = NAMED_BY.get(argument, f"{argument}|{argument.replace('_', ' ')}")
        for value in [*WRONG[number % every :: every], *for_argument(more_wrong(), name, argument, [])]:
            said = refusal(calls[name], **{argument: value})
            if said is None:
                assert is_right(value), f"{name}({argument}={shown(value)}) was accepted"
            else:
                assert re.search(rf"(?<!\w)({named})(?!\w)", said), f"{name}({argument}={shown(value)}): {said}"


@pytest.mark.usefixtures("before_sampling")
def test_a_switch_takes_true_and_false_alone(calls):
    """An argument that is a boolean by its annotation or its default."""
    found = []
    for name, call in calls.items():
        for parameter in inspect.signature(call.function).parameters.values():
            if parameter.annotation in (bool, "bool") or isinstance(parameter.default, bool):
                found.append((name, parameter.name))
                for value in ("no", 0, None):
                    said = refusal(call, **{parameter.name: value})
                    assert said is not None, (*found[-1], value)
                    assert f"{parameter.name} is {value!r}: give True or False" in said, (*found[-1], value)
    assert {("datasets.record", "truth"), ("design", "nested")} <= set(found)


# --- The checks themselves ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1, 0.5, np.float32(0.5), np.int8(3), np.array(2.0), xr.DataArray(2.0), math.inf])
def test_numbers_are_numbers(value):
    assert as_number(value) == float(value)
    assert as_numbers(value) == float(value)


def test_what_is_long_is_shown_by_its_kind():
    assert shown(xr.Dataset()) == "a Dataset"
    assert shown(np.zeros((50, 50))) == "a ndarray of shape (50, 50)"


def test_a_masked_number_is_none():
    """The number beneath the mask is nobody's."""
    masked = np.ma.masked_array([1.0, 2.0], [False, True])
    np.testing.assert_array_equal(as_numbers(masked), [1.0, np.nan])
    np.testing.assert_array_equal(check_array("x", masked), [1.0, np.nan])
    np.testing.assert_array_equal(as_numbers(np.ma.masked_array([1, 2], [True, False])), [np.nan, 2.0])
    assert type(check_array("x", np.ma.masked_array([1.0]))) is np.ndarray
    assert math.isnan(as_number(masked[1]))
    assert math.isnan(as_number(np.ma.masked_array(3.0, True)))
    assert as_numbers(np.ma.masked_array([True, False])) is None
    for refuse in (check_numbers, lambda name, value: tb.plotting.contour(value)):
        with pytest.raises(ParameterError, match="x"):
            refuse("x", masked)
