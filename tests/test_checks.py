"""Wrong arguments of the names that are used first: each is refused, in words, before anything is computed."""

import contextlib
import functools
import inspect
import math
import pathlib
import re
import warnings

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.public_calls import AcceptedError, end_before_sampling
from helpers.public_names import public
from helpers.refusals import refused
from helpers.wrong_values import WRONG
from tactile_bayes.checks import (
    as_number,
    as_numbers,
    check_array,
    check_choice,
    check_function,
    check_mapping,
    check_names,
    check_number,
    check_numbers,
    check_optional,
    check_path,
    check_pivots,
    check_positive,
    check_probability,
    check_switch,
    check_whole_number,
    shown,
)
from tactile_bayes.errors import ParameterError, TactileBayesError, TactileBayesWarning

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)


@functools.cache
def ideal():
    return tb.scan(tb.contours.Parabola(0.5, 0.5), drive_step=0.1).record


@functools.cache
def measured():
    return CELL.measure(ideal(), rng=1)


@functools.cache
def posterior():
    """A tree as `infer_contour` returns it, of a few draws."""
    draws = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    ends = {"first_contact_x": [0.9, -0.9], "snap_off_contact_x": [0.2, -0.1], "snap_off_drive_angle": [3.2, -0.1]}
    groups = {
        "posterior": xr.Dataset({k: (("chain", "draw"), np.full((2, 3), v)) for k, v in draws.items()}),
        "events": xr.Dataset(
            {k: (("chain", "draw", "segment"), np.broadcast_to(v, (2, 3, 2))) for k, v in ends.items()},
            coords={"segment": ["forward", "backward"]},
        ),
        "posterior_predictive": xr.Dataset({"force_x": (("chain", "draw", "sample"), np.zeros((2, 3, 4)))}),
    }
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = {"family": "parabola", "units": "dimensionless"}
    return tree


@functools.cache
def no_posteriors():
    """Trees that lack something."""
    unnamed = posterior().copy()
    unnamed.attrs = {}
    other = posterior().copy()
    other.attrs = {**posterior().attrs, "family": "circle"}
    groups = {name: posterior()[name].to_dataset().isel(draw=[]) for name in ("posterior", "events")}
    empty = xr.DataTree.from_dict(groups)
    empty.attrs = posterior().attrs
    words = posterior().copy()
    words["posterior"] = xr.DataTree(xr.Dataset({k: (("chain", "draw"), [["x"]]) for k in ("a", "q", "x_c")}))
    return [xr.DataTree(), xr.DataTree.from_dict({"posterior": xr.Dataset()}), unnamed, other, empty, words]


def no_records():
    bare = ideal().drop_vars("drive_angle")
    return [
        xr.Dataset(),
        xr.Dataset({"force_x": ("time", [1.0, 2.0])}),
        bare,
        ideal().isel(sample=[]),
        ideal().isel(sample=0),
        ideal().drop_attrs(),
        ideal().assign(force_x=("sample", ["a"] * ideal().sizes["sample"])),
        ideal().assign_attrs(rod_length="long"),
        ideal().assign_attrs(units=None),
        ideal().to_dataframe(),
        ideal()["force_x"],
    ]


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
UNKNOWN = [{"friction": None}, {"friction": "wide"}, {"left": 0.1}, {"friction": stats.norm}, {1: 0.1}, "everything"]


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


def kind(of, **attributes):
    return lambda value: isinstance(value, of) and all(getattr(value, name) == v for name, v in attributes.items())


def either(*rights):
    return lambda value: any(right(value) for right in rights)


def one_of(*words):
    return lambda value: isinstance(value, str) and value in words


def empty(*kinds):
    return lambda value: isinstance(value, kinds) and not isinstance(value, xr.Dataset | xr.DataTree) and not len(value)


def vacuous(wrong):
    """Whether an empty array stands beside what is wrong, so that of no contours at all it holds."""
    return len(wrong) > 1 and any(empty(list)(value) or getattr(value, "size", 1) == 0 for value in wrong.values())


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
NO_SHARES = [0.0, 1.0, 90.0]
FLAG = kind(bool | np.bool_)
RNG = either(whole(0), kind(np.random.Generator), kind(np.random.SeedSequence))
CELL_OR_NONE = either(nothing, kind(tb.LoadCell))
SETTINGS_OR_NONE = either(nothing, kind(tb.SamplerSettings))
PROGRESS = either(nothing, callable)


def cases(tmp_path):
    """By name: the function, a call that is right, what is right of each argument, and more that is wrong."""
    good = tmp_path / "good.csv"
    tb.write_record(ideal(), good)
    paths = {"path": ["\0", "folder/\0.csv", tmp_path, tmp_path / "record.txt", 3]}
    of_record, of_posterior = {"measured": no_records()}, {"posterior": no_posteriors()}
    of_random = {
        "measured": (measured(), never),
        "rng": (1, RNG),
        "settings": (None, SETTINGS_OR_NONE),
        "progress": (None, PROGRESS),
    }
    of_scan = {
        "contour": (tb.contours.Parabola(0.5, 0.5), kind(tb.contours.Circle, shape=())),
        "base": ((0.0, 0.0), pair),
        "rig": (None, either(nothing, kind(tb.Rig))),
    }
    no_bases = [[(0, 0), (1,)], [0.0, None], "here", (0.0,), (0.0, 0.0, 0.0), [(0.0, math.nan)], (math.nan, 0)]
    stated = tb.Rig(load_cell=CELL, unknown="nothing")
    of_contour = {**of_random, "rig": (stated, either(nothing, kind(tb.Rig)))}
    place = {"q": (0.5, numbers), "x_c": (0.0, numbers)}
    contours = {
        "Parabola": {"a": (0.5, numbers), **place},
        "Circle": {"r": (0.5, numbers), **place},
        "Ellipse": {"a": (0.5, numbers), "b": (0.4, numbers), **place},
        "PowerLaw": {"a": (0.5, numbers), "n": (2.0, numbers), **place},
    }
    sheet = dict(vars(tb.LoadCell()))
    of_sheet = {
        **dict.fromkeys([name for name in sheet if name.endswith(("noise", "resolution"))], AT_LEAST_0),
        **dict.fromkeys(("force_range", "moment_range", "degrees_of_freedom"), number(TINY, or_infinite=True)),
        **dict.fromkeys(("drive_angle_offset", "drive_angle_backlash"), number()),
        **dict.fromkeys(("lever", "moment_curve"), pair),
        "drift": nothing,
        "frame": nothing,
    }
    of_settings = {
        **dict.fromkeys(("block_steps", "max_steps"), whole(1, 10**9)),
        "ensembles": whole(2, 10**9),
        "walkers": nothing,
        "max_r_hat": number(1.1),
        "min_ess": POSITIVE,
        "max_seconds": either(nothing, POSITIVE),
        "events": FLAG,
    }
    of_rod = {
        "length": (0.1, number(0.1, 10.0)),
        "diameter": (0.0, number(0.0, 0.1)),
        "elastic_strain": (None, either(nothing, POSITIVE)),
    }
    made = {
        "scan": (
            tb.scan,
            {
                **of_scan,
                "direction": ("both", one_of("both", "forward", "backward")),
                "drive_step": (0.1, either(nothing, number(1e-6, 0.5))),
                "drive_angles": (None, either(nothing, row)),
                "drive": (None, either(nothing, kind(tb.Rotation))),
            },
            {"base": no_bases, "drive_angles": [["1", "2"], [90.0, 180.0], [[]]], "drive_step": ["1", 1]},
        ),
        "equilibria": (
            tb.equilibria,
            {
                **of_scan,
                "slope_angles": ([0.1], row),
                "direction": ("forward", one_of("forward", "backward")),
            },
            {"base": [*no_bases, [(0, 0), (1, 0)]], "slope_angles": [[10.0], [[0.1]]], "direction": ["both"]},
        ),
        "LoadCell": (
            tb.LoadCell,
            {name: (value, of_sheet.get(name, never)) for name, value in sheet.items()},
            {"gain": [np.zeros((3, 3)), [[1, 2, 3]] * 3], "bias": [[0, 0, "1"], [0, 0]]},
        ),
        "LoadCell.measure": (
            CELL.measure,
            {"record": (ideal(), never), "rng": (1, RNG)},
            {"record": no_records()},
        ),
        "LoadCell.from_record": (tb.LoadCell.from_record, {"record": (measured(), never)}, {"record": no_records()}),
        "LoadCell.from_zero_load": (
            tb.LoadCell.from_zero_load,
            {"record": (measured(), never), "false_alarm": (1e-3, number(TINY, 0.499))},
            {"record": no_records()},
        ),
        "zero_load": (
            tb.load_cell.zero_load,
            {"record": (measured(), never), "false_alarm": (1e-3, number(TINY, 0.499))},
            {"record": no_records(), "false_alarm": [0.5]},
        ),
        "read_record": (
            tb.read_record,
            {"path": (good, never), "rig": (None, either(nothing, kind(tb.Rig)))},
            paths,
        ),
        "write_record": (
            tb.write_record,
            {"record": (ideal(), never), "path": (tmp_path / "out.csv", never)},
            {**paths, "record": no_records()},
        ),
        "reconstruct": (
            tb.reconstruct,
            {
                "measured": (measured(), never),
                "method": ("constrained", one_of("raw", "constrained")),
                "rig": (stated, either(nothing, kind(tb.Rig))),
            },
            {**of_record, "measured": [*no_records(), ideal().drop_vars("force_y")]},
        ),
        "infer_contour": (
            tb.infer_contour,
            {
                **of_contour,
                "family": ("parabola", never),
                "checkpoint": (None, either(nothing, one_of("left", "0.1"))),
            },
            {**of_record, "checkpoint": ["\0"]},
        ),
        "Rig": (
            tb.Rig,
            {
                "rod": (None, either(nothing, kind(tb.Rod))),
                "load_cell": (CELL, CELL_OR_NONE),
                "unknown": ({}, either(empty(dict), one_of("nothing"))),
                "file": ({}, empty(dict)),
            },
            {
                "unknown": UNKNOWN,
                "file": [{"force_x": None}, {"left": "Fx"}, {"missing": ["left"]}, {"split_sweeps": 1}],
            },
        ),
        "Family": (
            functools.partial(tb.Family, "circle"),
            {"r": (0.2, either(POSITIVE, frozen)), "x_c": (0.0, either(number(), frozen))},
            {"r": [0.0, -1.0, stats.norm, stats.norm(0.1, 0.0)]},
        ),
        "SamplerSettings": (
            tb.SamplerSettings,
            {name: (value, of_settings[name]) for name, value in vars(tb.SamplerSettings()).items()},
            {"ensembles": [1, 2.0], "walkers": [2, 7], "max_r_hat": [1.0], "min_ess": [0.0], "max_seconds": [0.0]},
        ),
        "contour_band": (
            tb.contour_band,
            {
                "posterior": (posterior(), never),
                "x": ([0.0, 0.1], lambda value: row(value) or empty(list)(value)),
                "probability": (0.9, SHARE),
                "simultaneous": (False, FLAG),
            },
            {**of_posterior, "x": [[[0.0, 1.0]], [0.0, math.nan]], "probability": NO_SHARES},
        ),
        "predictive_interval": (
            tb.uncertainty.predictive_interval,
            {"posterior": (posterior(), never), "probability": (0.9, SHARE)},
            {"probability": NO_SHARES},
        ),
        "gap": (
            tb.gap,
            {"posterior": (posterior(), never), "probability": (0.9, SHARE), "without_events": (None, nothing)},
            {**of_posterior, "without_events": no_posteriors(), "probability": NO_SHARES},
        ),
        **{name: (getattr(tb.contours, name), arguments, {}) for name, arguments in contours.items()},
        "Rod": (tb.Rod, {**of_rod, "flexural_rigidity": (1.0, POSITIVE)}, {}),
        "Rod.circular": (
            tb.Rod.circular,
            {**of_rod, "diameter": (1e-3, number(1e-3, 0.1)), "youngs_modulus": (2e11, number(1.0, 1e12))},
            {},
        ),
        "compare_families": (
            tb.compare_families,
            {
                **{name: of_random[name] for name in ("measured", "rng", "settings", "progress")},
                "rig": (stated, either(nothing, kind(tb.Rig))),
                "families": (["parabola", "circle"], never),
                "leave_one_out": (False, FLAG),
                "false_alarm": (1e-3, SHARE),
            },
            {
                **of_record,
                "families": [["parabola"], ["parabola", 1], ["parabola", "left"], ["circle"] * 2],
            },
        ),
        "infer_contacts": (
            tb.infer_contacts,
            {
                **{name: of_random[name] for name in ("measured", "rng", "progress")},
                "rig": (stated, either(nothing, kind(tb.Rig))),
                "prior": ("flat", one_of("flat", "polar")),
                "draws": (4, lambda value: whole(4, 10**6)(value) and value % 4 == 0),
            },
            {**of_record, "draws": [2, 10, 4.0, "4"], "rng": [-1]},
        ),
    }
    assert set(made) == set(CASES)
    return made


CASES = (
    "scan",
    "equilibria",
    "LoadCell",
    "LoadCell.measure",
    "LoadCell.from_record",
    "LoadCell.from_zero_load",
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
    "Parabola",
    "Circle",
    "Ellipse",
    "PowerLaw",
    "Rod",
    "Rod.circular",
    "compare_families",
    "infer_contacts",
)


@pytest.fixture
def before_sampling(monkeypatch, tmp_path):
    """Have calls that would sample end where they would begin to."""

    end_before_sampling(monkeypatch)
    monkeypatch.chdir(tmp_path)


def refusal(call, **options):
    """The words in which a call is refused, if it is; another error than one of the package, or a foreign warning,
    fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TactileBayesWarning)
        try:
            call(**options)
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


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", CASES)
def test_a_wrong_argument_is_refused_in_words(name, every, before_sampling, tmp_path):
    """Of what is wrong anywhere each argument is given every third, beside all that is wrong of it alone."""
    call, arguments, more = cases(tmp_path)[name]
    usual = {argument: value for argument, (value, _) in arguments.items()}
    assert refusal(call, **usual) is None
    for number, (argument, (_, is_right)) in enumerate(arguments.items()):
        named = NAMED_BY.get(argument, f"{argument}|{argument.replace('_', ' ')}")
        for value in [*WRONG[number % every :: every], *more.get(argument, [])]:
            said = refusal(call, **{**usual, argument: value})
            if said is None:
                assert is_right(value), f"{name}({argument}={shown(value)}) was accepted"
            else:
                assert re.search(rf"(?<!\w)({named})(?!\w)", said), f"{name}({argument}={shown(value)}): {said}"


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_wrong_arguments_in_pairs_are_refused_in_words(name, before_sampling, tmp_path):
    """A thousand pairs of them for each name."""
    rng = np.random.default_rng(CASES.index(name))
    call, arguments, more = cases(tmp_path)[name]
    usual = {argument: value for argument, (value, _) in arguments.items()}
    values = {argument: [*WRONG, *more.get(argument, [])] for argument in arguments}
    for _ in range(1000):
        chosen = map(str, rng.choice(list(arguments), size=min(2, len(arguments)), replace=False))
        wrong = {argument: values[argument][rng.integers(len(values[argument]))] for argument in chosen}
        if refusal(call, **{**usual, **wrong}) is None and not vacuous(wrong):
            for argument, value in wrong.items():
                assert arguments[argument][1](value), f"{name}({argument}={shown(value)}) was accepted"


def test_an_unknown_keyword_is_python_s_to_refuse(tmp_path):
    for name, (call, arguments, _) in cases(tmp_path).items():
        with refused(ParameterError if name == "Family" else TypeError, "left"):
            call(**{argument: value for argument, (value, _) in arguments.items()}, left=1)


# --- The checks themselves ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1, 0.5, np.float32(0.5), np.int8(3), np.array(2.0), xr.DataArray(2.0), math.inf])
def test_numbers_are_numbers(value):
    assert as_number(value) == float(value)
    assert as_numbers(value) == float(value)


REFUSALS = {
    "number": (functools.partial(check_number, least=0.0), [0, np.int8(3)], [-1.0, math.nan, "1", True, [1.0], 1j]),
    "positive": (check_positive, [math.ulp(0.0), np.array(2.0)], [0.0, math.inf, None, np.bool_(True), np.ones(1)]),
    "probability": (check_probability, [0.4, np.float32(0.5)], [0.0, 1.0, math.nan, True, "0.5"]),
    "share": (functools.partial(check_probability, below=0.5), [0.4], [0.5]),
    "numbers": (check_numbers, [[1, 2.5], 3, []], [[1, "2"], [True, 1.0], [[1, 2], [3]], [math.inf], None, "12"]),
    "list": (functools.partial(check_numbers, shape=(None,), most=2.0), [[1, 2], (0.5,)], [[], 1.0, [[1.0]], [3.0]]),
    "lever": (functools.partial(check_numbers, shape=(2,)), [(0, 1)], [(0, 1, 2), (0,), [[0, 1]]]),
    "base": (check_pivots, [(0, 1), [(0, 1), (2, 1)]], [(0, 1, 2), [], [(0, 1), (2,)], (0, math.nan), 1.0, "01"]),
    "draws": (functools.partial(check_whole_number, least=2), [np.uint8(2), 3], [True, 2.0, "2", None, 1]),
    "replicate": (lambda name, value: check_whole_number(name, value, 0, most=9), [9], [10, -1, False]),
    "method": (
        functools.partial(check_choice, choices=("raw", "constrained")),
        ["raw"],
        ["left", ["raw"], None, b"raw"],
    ),
    "rod": (functools.partial(check_optional, kind=tb.Rod), [None, tb.Rod()], [tb.Rod, 1.0, {}]),
    "events": (check_switch, [True, np.bool_(False)], [0, 1, None, "True"]),
    "progress": (check_function, [None, print], [1, "print"]),
    "nuisances": (
        check_names,
        [["a", "b"], ("a",), np.array(["a"]), {"a": 1}.keys()],
        ["a", b"ab", {"a": 1}, ["a", 1], None, iter("ab")],
    ),
    "priors": (
        functools.partial(check_mapping, correction="give names"),
        [None, {}, {"q": 1}],
        [{1: 2.0}, [], "q", xr.Dataset()],
    ),
    "path": (check_path, ["record.csv", pathlib.Path("out")], ["", "\0", b"record.csv", 3, None]),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_a_check_takes_what_is_right_and_refuses_the_rest_by_name_and_with_a_correction(name):
    check, right, wrong = REFUSALS[name]
    for value in right:
        check(name, value)
    for value in wrong:
        with pytest.raises(ParameterError, match=rf"(?s)^{name} is {re.escape(shown(value))}.*: .*(give|choose) "):
            check(name, value)


def test_checks_return_what_they_checked_as_it_is_used():
    assert check_whole_number("draws", np.uint8(2), 2) == 2
    assert check_numbers("span", (0, 1)).tolist() == [0.0, 1.0]
    assert check_pivots("base", (0, 1)) == [(0.0, 1.0)]
    assert check_names("nuisances", np.array(["a", "b"])) == ["a", "b"]
    assert check_path("path", "record.csv") == pathlib.Path("record.csv")


def test_what_is_long_is_shown_by_its_kind():
    assert shown(xr.Dataset()) == "a Dataset"
    assert shown(np.zeros((50, 50))) == "a ndarray of shape (50, 50)"


# --- Switches -----------------------------------------------------------------------------------------------------


def switches():
    """(name of a public function, its boolean parameter), by annotation or default."""
    for module, name, _ in public():
        value = getattr(module, name)
        methods = [f"{name}.{own}" for own in dir(value) if inspect.isclass(value) and not own.startswith("_")]
        for label in [name, *methods]:
            function = functools.reduce(getattr, label.split("."), module)
            if not callable(function) or inspect.ismodule(function):
                continue
            with contextlib.suppress(ValueError, TypeError):  # of some builtins
                for parameter in inspect.signature(function).parameters.values():
                    if parameter.annotation in (bool, "bool") or isinstance(parameter.default, bool):
                        yield module, label, parameter.name


def required():
    """Values of required parameters, by name."""
    contours = [{"family": "parabola", "a": 0.6, "q": 0.5}]
    return {
        "bands": {},
        "axial": np.linspace(0.1, 0.2, 12),
        "contour": tb.contours.Circle(0.5, 0.5),
        "families": ["parabola", "circle"],
        "gauge": {"r": 0.5, "q": 0.5},
        "index": 0,
        "known": "parabola",
        "lateral": np.linspace(0.01, 0.02, 12),
        "measured": measured(),
        "name": "part",
        "number": 0,
        "parameters": {"r": 0.5, "q": 0.5},
        "path": pathlib.Path(__file__).parents[1] / "data" / "synthetic" / "rig.csv",
        "polyline": tb.contours.Polyline([[(0.0, 0.0), (1.0, 0.0)]]),
        "posterior": posterior_with_prior(),
        "predicted": [[[0.1, 0.1, 0.1]]],
        "reading": np.linspace(1.0, 2.0, 12),
        "record": measured(),
        "records": measured(),
        "run_or_posterior": posterior_with_prior(),
        "rng": 0,
        "self": CELL,
        "source": {"records": 1, "seed": 1, "contours": contours},
        "x": [0.0, 0.1],
    }


def posterior_with_prior():
    tree = posterior().copy()
    tree["prior"] = tree["posterior"].copy()
    tree["constant_data"] = xr.DataTree(xr.Dataset())
    return tree


@pytest.mark.parametrize("value", ["no", 0, None], ids=repr)
@pytest.mark.parametrize(
    ("module", "label", "name"), list(switches()), ids=lambda part: getattr(part, "__name__", part)
)
def test_a_switch_takes_true_and_false_alone(module, label, name, value):
    if label == "Specification":
        given = vars(tb.datasets.read_specification(required()["source"])) | {name: value}
    else:
        function = functools.reduce(getattr, label.split("."), module)
        needed = inspect.signature(function).parameters.values()
        kinds = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
        table = required()
        given = {one.name: table[one.name] for one in needed if one.default is one.empty and one.kind not in kinds}
        given[name] = value
    with refused(ParameterError, f"{name} is {value!r}: give True or False"):
        functools.reduce(getattr, label.split("."), module)(**given)


def test_the_switches_are_found():
    assert {("record", "truth"), ("design", "nested")} <= {(label, name) for _, label, name in switches()}


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
