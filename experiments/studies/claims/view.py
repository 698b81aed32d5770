"""The paper's claims, one row each: what simulation, measured matrices and theory say of it.

Nothing is measured here: every number is what another study says, and every verdict is made of such
numbers by a rule that the table states. What has no record says so, with what would make it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.records import configs
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.estimates import (
    Difference,
    Estimate,
    difference,
    mean_difference,
    mean_interval,
    share,
)
from experiments.reporting.measured import with_places
from experiments.reporting.rows import display_name, row
from experiments.reporting.study import RUN, Quantity, Study
from experiments.reporting.table import Table, frame, interval, number, percent, points
from experiments.studies.accuracy.view import quantities as of_accuracy
from experiments.studies.benchmark.view import ORDINARY
from experiments.studies.conditions import verdict as conditions
from experiments.studies.conditions.view_linear import ADAM, SECONDS
from experiments.studies.conditions.view_linear import NAME as CONDITIONS
from experiments.studies.conditions.view_optics import explaining
from experiments.studies.correlation.view import SYMBOLS, contrast, matrices
from experiments.studies.crossing.view import crossings
from experiments.studies.drift.view import N_NEW, PAPERS, n_tested
from experiments.studies.drift.view import Key as RecalibratedBy
from experiments.studies.drift.view import accuracies as recalibrated
from experiments.studies.models.view import BY_STEPS, MEASURED, models, scenes
from experiments.studies.models.view import EXPERIMENT as ALL_SCENES
from experiments.studies.robustness.view import FLIPS
from experiments.studies.robustness.view import accuracies as disturbed
from experiments.studies.table1.view import PAPER
from experiments.studies.table1.view import quantities as of_table1

LINEAR = ("softmax_dual", "ridge")
FIBRE = "fibre"
PRECISE = "tactile_precise"
BEST = 3  # rivals that are named
FEW = 50  # training samples up to which N is few
TIMES = 10  # how many times HDC's a training has to take for HDC's to be a small part
POINTS = 0.03  # the margin of accuracies in published.csv
RULES = (
    "Every number is of the records, by the studies below; verdicts are made of them by rule. "
    "Intervals: 95 %, Student over seeds; of differences from HDC seed by seed, in percentage "
    "points. Ahead or behind: the interval of the difference leaves out zero. Recognises better: "
    "holds where HDC is ahead of every rival that was run there, does not hold where one is ahead "
    "of HDC; none ahead: neither. Time: holds if a rival takes "
    f"{TIMES} times as long by both ways to compute HDC, at the lower end of the interval of one "
    "run, which fewer than three runs have not; an effect of how HDC is written if by one way "
    "only. Few samples: mean over all N up to "
    f"{FEW} that were asked. Contrast: holds if that of prototypes, on samples outside of them, is "
    "larger than that of speckle and of hypervectors; an effect of averaging if theory comes "
    "within the margin of published.csv. Recalibration: holds if more accurate than before; beside "
    "it, whether the new samples alone restore less. Faults: the largest bit error rate that costs "
    f"at most {100 * POINTS:g} points; mostly an effect of the number format if 8-bit numbers "
    "close more than half of the decades, and only that if they close all. Texture: an effect of "
    "thickness if that alone gives the accuracy, and texture alone less than half way from chance "
    "to it."
)


class Claim(NamedTuple):
    """A row of the table.

    Attributes:
        claim: in short.
        paper: its numbers, and where they stand.
        simulated, fibre: what simulated frames, and those of measured fibre matrices, say.
        why: theory or mechanism.
        verdict: what holds.
    """

    claim: str
    paper: str
    simulated: str
    fibre: str
    why: str
    verdict: str


def tables(results: Results) -> Iterator[Table]:
    """One row a claim, and what it rests on."""
    asked = (results.measured(name) for name in ("correlation", "drift", "robustness"))
    if not {*scenes()} & set(results.scenes) and not any(asked):
        return
    makers: Sequence[Callable[[Results], Claim]] = (
        recognition,
        training_time,
        few_samples,
        sharpening,
        recalibration,
        faults,
        texture,
    )
    claims = [make(results)._asdict() for make in makers]
    yield Table(
        "claims",
        "What holds of the paper",
        frame([{key: row[key] for key in ("claim", "paper", "verdict")} for row in claims]),
        {
            "Claim": lambda row: row["claim"],
            "Paper": lambda row: row["paper"],
            "What holds": lambda row: row["verdict"],
        },
    )
    yield Table(
        "claims_evidence",
        "What the verdicts rest on",
        frame(
            [{key: row[key] for key in ("claim", "simulated", "fibre", "why")} for row in claims]
        ),
        {
            "Claim": lambda row: row["claim"],
            "On simulated frames": lambda row: row["simulated"],
            "On measured fibre matrices": lambda row: row["fibre"],
            "Theory or mechanism": lambda row: row["why"],
        },
        RULES,
        folded=True,
    )


def missing(command: str) -> str:
    """What a cell says of what has no record."""
    return f"not measured yet ({command})"


# Accuracy -----------------------------------------------------------------------------------------


def recognition(results: Results) -> Claim:
    """HDC recognises better than softmax regression and networks."""
    rivals = list(dict.fromkeys([*models()[1:], *PAPER[1:]]))
    over = {
        scene: {m: one.share for m, one in _over_hdc(results, scene, rivals).items()}
        for scene in scenes()
    }
    measured = {scene: over.pop(scene) for scene in MEASURED}
    paper = ", ".join(
        f"{display_name(model)} {published.numbers()[f'table1/{model}_test_accuracy'].value:g} %"
        for model in PAPER
    )
    trained = [
        f"{published.numbers()[f'table1/{model}_training_accuracy'].value:g} %"
        for model in PAPER[1:]
    ]
    softmax = results.group("touch", "softmax")
    here = missing(f"{RUN}table1")
    if softmax.runs:
        record = softmax.runs[0].record
        right = np.mean([run.record.train_accuracy_final for run in softmax.runs])
        here = (
            f"here {percent(float(right))} % of {record.n_train} frames of "
            f"{math.prod(record.scene.shape):,} pixels"
        )
    return Claim(
        "HDC recognises slightly better",
        f"{paper} (Table I)",
        _accuracies(results, over),
        _accuracies(results, measured),
        "fewer frames than pixels are linearly separable: a softmax regression that is trained on "
        f"has all of them right ({here}). The published {', '.join(trained)} in training are of "
        "trainings that ended before, from weights and at a moment that the paper does not state. "
        f"{_conditions(results)}",
        _both(_where_ahead(measured), _where_ahead(over)),
    )


def _both(fibre: str, simulated: str) -> str:
    """What holds on either kind of frames."""
    return f"measured fibre: {fibre}; simulated: {simulated}"


def _conditions(results: Results) -> str:
    """What would have to be true for the published row of softmax regression."""
    measured = results.measured(CONDITIONS)
    if measured is None:
        return f"What makes the published row: {missing(f'{RUN}{CONDITIONS}')}"
    lines = _lines(results)
    text = conditions.conclusion(lines, measured.record.config["starts"]).removesuffix(".")
    if alone := explaining(results):
        text += f". Test accuracies alone would also be explained by {'; '.join(alone)}"
    return text


def _lines(results: Results) -> list[dict[str, Any]]:
    """Every condition of softmax regression, with its verdict."""
    measured, adam, seconds = map(results.measured, (CONDITIONS, ADAM, SECONDS))
    rows = [row for one in (measured, adam) for row in conditions.rows_of(one)]
    return conditions.conditions(rows, conditions.rows_of(seconds), conditions.criterion())


def _over_hdc(
    results: Results, scene: str, models: Sequence[str], n_train: int | None = None
) -> dict[str, Difference]:
    """How much more than HDC the models have right that were run on the scene."""
    hdc = results.group(scene, "hdc", n_train)
    found = {
        model: difference(results.group(scene, model, n_train).runs, hdc.runs) for model in models
    }
    return {model: one for model, one in found.items() if one is not None}


def _accuracies(results: Results, over: Mapping[str, Mapping[str, Estimate]]) -> str:
    """HDC's accuracy on each scene and what the best rivals have over it; what is lost last."""
    said, lost = [], []
    for scene, found in over.items():
        hdc = results.group(scene, "hdc")
        if hdc.runs:
            said.append(f"{scene}: HDC {percent(share(hdc).value)} %")
        if found:
            best = sorted(found, key=lambda model: -found[model].value)[:BEST]
            rivals = "; ".join(f"{display_name(m)} {_points(found[m])}" for m in best)
            said[-1] += f", the best of {len(found)} rivals over it: {rivals}"
        else:
            lost.append(scene)
    if lost:
        said.append(f"rivals on {', '.join(lost)}: {missing(_command(lost))}")
    return ". ".join(said)


def _command(scenes_: Sequence[str]) -> str:
    where = " scene.path=FOLDER" if set(scenes_) & set(MEASURED) else ""
    return f"{RUN}{ALL_SCENES} scene={','.join(scenes_)}{where}"


def _points(found: Estimate) -> str:
    return interval(*(points(part) for part in found))


def _where_ahead(over: Mapping[str, Mapping[str, Estimate]]) -> str:
    """On which scenes HDC is ahead of all rivals, behind one, and neither."""
    said: dict[str, list[str]] = {"does not hold": [], "holds": [], "none ahead": []}
    for scene, found in over.items():
        known = {model: one for model, one in found.items() if not np.isnan(one.low)}
        if not known:
            continue
        if behind := [model for model, one in known.items() if one.low > 0]:
            best = max(behind, key=lambda model: known[model].value)
            more = f" and {len(behind) - 1} more" if len(behind) > 1 else ""
            said["does not hold"].append(f"{scene} ({display_name(best)}{more} ahead)")
        elif all(one.high < 0 for one in known.values()):
            said["holds"].append(scene)
        else:
            said["none ahead"].append(scene)
    text = ", ".join(f"{words} on {', '.join(where)}" for words, where in said.items() if where)
    return text or "not decided, too few seeds of HDC and a rival on the same frames"


# Time ---------------------------------------------------------------------------------------------


def training_time(results: Results) -> Claim:
    """HDC trains in about a hundredth of the others' time."""
    found: dict[str, dict[str, Quantity]] = {}
    for quantity in of_table1(results):
        if quantity.name.endswith("_time_over_hdc"):
            model = quantity.name.partition("/")[2].removesuffix("_time_over_hdc")
            found.setdefault(model, {})[quantity.condition] = quantity
    said, verdicts = [], []
    for model, ways in found.items():
        texts = [f"{condition}: {_ratio(one)}" for condition, one in ways.items()]
        said.append(f"{display_name(model)}, {', '.join(texts)}")
        verdicts.append(f"{display_name(model)}: {_time_verdict(list(ways.values()))}")
    numbers = published.numbers()
    ratios = {model: numbers[f"table1/{model}_time_over_hdc"].value for model in PAPER[1:]}
    paper = ", ".join(f"{display_name(model)} ×{number(r)}" for model, r in ratios.items())
    return Claim(
        "It trains in a small part of the time",
        f"{paper} of its {numbers['table1/hdc_training_time'].value:g} s (Table I)",
        "; ".join(said) or missing(f"{RUN}table1"),
        _times_on_fibre(results),
        _why_slow(),
        f"as trained here, {'; '.join(verdicts)}{_range(results)}"
        if verdicts
        else "not decided: not measured yet",
    )


def _times_on_fibre(results: Results) -> str:
    hdc = results.group(FIBRE, "hdc")
    found = [(model, row(results.group(FIBRE, model), hdc)) for model in BY_STEPS]
    said = [
        f"{display_name(model)} ×{number(line['training_time_over_hdc'])}"
        for model, line in found
        if line.get("training_time_over_hdc") is not None
    ]
    if not said:
        return missing(f"{_command([FIBRE])} model=hdc,{','.join(BY_STEPS)}")
    pixels = math.prod(hdc.runs[0].record.scene.shape)
    return f"HDC as written here, frames of {pixels:,} pixels: {'; '.join(said)}"


def _ratio(one: Quantity) -> str:
    if one.value is None:
        return missing(one.made_by)
    return f"×{interval(*(number(part) for part in (one.value, one.low, one.high)))}"


def _time_verdict(ways: Sequence[Quantity]) -> str:
    known = [one for one in ways if one.low is not None and one.high is not None]
    if len(known) < len(ways):
        return f"not decided without {ORDINARY}" if known else "not decided"
    holds = [one.low >= TIMES for one in known if one.low is not None]
    fails = [one.high < TIMES for one in known if one.high is not None]
    if all(holds):
        return "holds"
    if all(fails):
        return "does not hold"
    return "an effect of how HDC is written" if any(holds) and any(fails) else "not decided"


def _why_slow() -> str:
    return (
        "seconds to 90 % are seconds a step times steps; how many steps it takes depends on the "
        "optimiser and the initial weights, which the paper does not state, and on its learning "
        f"rate of {published.numbers()['table1/learning_rate'].value:g}; which of them make the "
        f"published time is what experiment={CONDITIONS} asks"
    )


def _range(results: Results) -> str:
    """How long softmax regression takes over all conditions."""
    times = [line["times_hdc"] for line in _lines(results) if line["times_hdc"] is not None]
    if not times:
        return ""
    low, high = number(min(times)), number(max(times))
    return (
        f"; by the recipes that the paper leaves open, softmax regression takes ×{low} to ×{high}"
    )


# Few samples --------------------------------------------------------------------------------------


def few_samples(results: Results) -> Claim:
    """HDC needs few samples."""
    known = published.numbers()["accuracy_vs_n/n_for_90_percent"]
    crossing = _first(of_accuracy(results), known.name)
    sweep = configs.sweep("accuracy_vs_n")
    sizes = [n for n in configs.numbers(sweep["split.n_train"]) if n is not None and n <= FEW]
    simulated, fibre = (_over_all(results, scene, sizes) for scene in (sweep["scene"][0], FIBRE))
    recipe = {"softmax": simulated.pop("softmax")} if "softmax" in simulated else {}
    fibre.pop("softmax", None)
    over = f"over HDC, mean of N = {sizes[0]} to {sizes[-1]}"
    said = []
    if crossing is not None:
        said.append(f"a sensor's mean accuracy first exceeds 90 % at N = {_value(crossing)}")
    once = next((one for one in crossings(results) if one.model == "hdc"), None)
    if once is not None:
        said.append(
            f"in one experiment first above it at N = {_estimate(once.first)}, with "
            f"{known.value:g} or fewer in {percent(once.p_at_most_published.value)} % of them"
        )
    else:
        said.append(f"one experiment: {missing(f'{RUN}crossing')}")
    if simulated:
        said.append(f"{over}: {_means(simulated | recipe)}")
    suffice = "not decided how many suffice"
    if crossing is not None:
        fitted = f" (a {known.calibration} number)" if known.calibration else ""
        suffice = f"simulated, above 90 % from N = {_value(crossing)} on average{fitted}"
    return Claim(
        "Few samples suffice",
        f"above 90 % only for N > {known.value:g} (Fig. 5(b))",
        "; ".join(said),
        f"{over}: {_means(fibre)}"
        if fibre
        else missing(f"{_command([FIBRE])} split.n_train={','.join(map(str, sizes))}"),
        "a prototype is the mean of its samples, cut to bits: its variance falls as 1/N, as that "
        "of every linear read-out of the pixels, which keeps what the bits lose; by Adam at the "
        "published rate softmax regression separates few frames in its first steps, and is done",
        f"{suffice}. Fewer than softmax regression as trained here: simulated: {_fewer(recipe)}. "
        f"Fewer than the best linear models: {_both(_fewer(fibre), _fewer(simulated))}",
    )


def _over_all(results: Results, scene: str, sizes: Sequence[int]) -> dict[str, Estimate]:
    """How much more than HDC the linear models have right on a scene, mean over all these N, by
    seeds that have them all."""
    models = (*LINEAR, "softmax")
    at = [_over_hdc(results, scene, models, n) for n in sizes]
    found = {}
    for model in models:
        each = [one[model].each for one in at if model in one]
        if len(each) == len(sizes):
            seeds = set.intersection(*map(set, each))
            means = [float(np.mean([one[seed] for one in each])) for seed in sorted(seeds)]
            if means:
                found[model] = mean_interval(means)
    return found


def _means(found: Mapping[str, Estimate]) -> str:
    return "; ".join(f"{display_name(model)} {_points(one)}" for model, one in found.items())


def _fewer(found: Mapping[str, Estimate]) -> str:
    """Whether HDC does better than the linear models with as many samples."""
    known = {model: one for model, one in found.items() if not np.isnan(one.low)}
    if behind := [display_name(model) for model, one in known.items() if one.low > 0]:
        return f"does not hold ({' and '.join(behind)} ahead)"
    if not known:
        return "not decided"
    return "holds" if all(one.high < 0 for one in known.values()) else "none ahead"


def _value(one: Quantity) -> str:
    return interval(*(number(part) for part in (one.value, one.low, one.high)))


def _first(quantities: Iterator[Quantity], name: str) -> Quantity | None:
    return next((one for one in quantities if one.name == name), None)


# Contrast -----------------------------------------------------------------------------------------


class Sharpening(NamedTuple):
    """Contrasts of one measurement.

    Attributes:
        origin: of its frames.
        contrast: ΔC of speckle, hypervectors, and prototypes on held-out samples, mean over seeds.
        theory: what theory makes of C^b.
        ratio: ΔC of prototypes over that of the other two.
    """

    origin: str
    contrast: Mapping[str, Estimate]
    theory: Estimate
    ratio: Mapping[str, Estimate]


def sharpening(results: Results) -> Claim:
    """Prototypes have more contrast than speckle and hypervectors."""
    found = [_sharpening(measured) for _, measured in with_places(results, "correlation")]
    simulated = [one for one in found if one.origin == "simulated"]
    fibre = [one for one in found if one.origin == "measured"]
    numbers = published.numbers()
    paper = ", ".join(f"{numbers[f'correlation/contrast_{kind}'].value:g}" for kind in SYMBOLS)
    margin = numbers["correlation/contrast_prototype"].margin or 0.0
    command = f"{RUN}correlation"
    why = (
        "the majority of n hypervectors that correlate by c keeps what they share and averages the "
        "rest: every correlation with it, within and between classes, is multiplied by "
        "√(2/π)·√(n/(1 + (n − 1)c)), which is less than 1 where c exceeds 2/π"
    )
    if found:
        said = ", ".join(f"{one.origin} {_estimate(one.theory)}" for one in found)
        why += f". ΔC^p by this, from C^b alone: {said}"
    return Claim(
        "Prototypes sharpen the contrast",
        f"ΔC of speckle, hypervectors, prototypes: {paper} (Fig. 4(e))",
        "; ".join(map(_contrasts, simulated)) or missing(command),
        "; ".join(map(_contrasts, fibre))
        or missing(f"{command} scene=fibre scene.path=FOLDER task.crop=null"),
        why,
        _by_origin({one.origin: _sharpened(one, margin) for one in found}) or "not decided",
    )


def _by_origin(said: Mapping[str, str]) -> str:
    names = {"measured": "measured fibre"}
    return "; ".join(f"{names.get(one, one)}: {words}" for one, words in sorted(said.items()))


def _sharpening(measured: Measured) -> Sharpening:
    bits = matrices(measured, "hypervector", "all")[1]
    n = matrices(measured, "hypervector", "training")[2]
    of = {kind: [contrast(c) for c in matrices(measured, kind, "all")[1]] for kind in SYMBOLS}
    of["prototype"] = [contrast(c) for c in matrices(measured, "prototype", "held-out")[1]]
    ratios = {
        words: [p / other for p, other in zip(of["prototype"], of[kind], strict=True)]
        for kind, words in (("speckle", "speckle"), ("hypervector", "hypervectors"))
    }
    return Sharpening(
        measured.rows[0]["origin"],
        {kind: mean_interval(values) for kind, values in of.items()},
        mean_interval([contrast(averaged(c, n)) for c in bits]),
        {kind: mean_interval(values) for kind, values in ratios.items()},
    )


def averaged(correlation: np.ndarray, n: int) -> np.ndarray:
    """Correlations of a majority of n with other hypervectors, from those of single ones [L, L].

    The sum S of n signs has the variance n·(1 + (n − 1)·c) and the covariance n·c′ with another
    sign; of Gaussian S, sign(S) has √(2/π) of its correlation.
    """
    own = np.diag(correlation)[:, None]
    return np.sqrt(2 / np.pi * n / (1 + (n - 1) * own)) * correlation


def _contrasts(one: Sharpening) -> str:
    speckle, bits, prototype = (_estimate(one.contrast[kind]) for kind in SYMBOLS)
    return (
        f"ΔC^s {speckle}, ΔC^b {bits}, ΔC^p of samples that are not in the prototypes {prototype}: "
        + ", ".join(f"×{_estimate(ratio)} of {kind}" for kind, ratio in one.ratio.items())
    )


def _estimate(found: Estimate) -> str:
    return interval(*(number(part) for part in found))


def _sharpened(one: Sharpening, margin: float) -> str:
    below = [kind for kind, ratio in one.ratio.items() if ratio.high < 1]
    above = [kind for kind, ratio in one.ratio.items() if ratio.low > 1]
    if below:
        more = f", above {above[0]}" if above else ""
        return f"does not hold, below {' and '.join(below)}{more}"
    if len(above) < len(one.ratio):
        return "not decided"
    beyond = one.contrast["prototype"].value - one.theory.value
    if abs(beyond) <= margin:
        return "holds, as an effect of averaging"
    return f"holds, by {'more' if beyond > 0 else 'less'} than averaging"


# Recalibration ------------------------------------------------------------------------------------


def recalibration(results: Results) -> Claim:
    """An update of prototypes restores accuracy."""
    before, after = (
        published.numbers()[f"drift/{name}_accuracy"].value for name in ("stored", "recovered")
    )
    claim = (
        "Recalibration restores accuracy after drift",
        f"{before:g} to {after:g} % with N_new = {N_NEW}, p = 0.5 or 0.75 (Fig. 8(b))",
    )
    none = "not measured: the public data have one session (scene=recorded takes one's own of two)"
    measured = results.measured("drift")
    # Records from before there was an order do not say which samples were new.
    known = measured is not None and "order" in measured.rows[0]
    found = recalibrated(measured) if measured is not None and known else {}

    def values(method: str, n: int, *parameters: str) -> NDArray[np.float64] | None:
        keys = [RecalibratedBy("time", "hdc", method, p) for p in parameters or ("",)]
        each = [found.get(key, {}).get(n) for key in keys]
        new_room = [one[:, 0] for one in each if one is not None]
        return np.mean(new_room, axis=0) if len(new_room) == len(keys) else None

    old, mixed = values("stored", 0), values("replace", N_NEW, *PAPERS)
    new = values("new", N_NEW)
    if measured is None or old is None or mixed is None or new is None:
        return Claim(*claim, missing(f"{RUN}drift"), none, "–", "not decided: not measured yet")
    restored, gain = (
        mean_difference((mixed - other).tolist(), n_tested(measured)) for other in (old, new)
    )
    return Claim(
        *claim,
        f"before {percent(old.mean())} %, with {N_NEW} new samples, the first in time, "
        f"{percent(mixed.mean())} %, the mean of p = 0.5 and 0.75: {_points(restored)} points",
        none,
        f"the new samples alone (p = 1) give {percent(new.mean())} %; the old prototypes add "
        f"{_points(gain)} points to it",
        _by_origin({measured.rows[0]["origin"]: _restores(restored, gain)})
        + f" ({percent(old.mean())} to {percent(mixed.mean())} %; those alone "
        f"{percent(new.mean())} %)",
    )


def _restores(restored: Estimate, gain: Estimate) -> str:
    if np.isnan(restored.low) or restored.low <= 0 <= restored.high:
        return "not decided"
    if restored.high < 0:
        return "does not hold"
    if gain.low > 0:
        return "holds, by more than the new samples alone"
    if gain.high < 0:
        return "holds, but the new samples alone restore more"
    return "holds; nothing told beyond the new samples alone"


# Faults -------------------------------------------------------------------------------------------


def faults(results: Results) -> Claim:
    """HDC tolerates faults."""
    claim = "HDC tolerates faults", "no error-prone bits (Introduction; not measured there)"
    found = {one.rows[0]["origin"]: one for _, one in with_places(results, "robustness")}
    rates = {origin: _tolerated(measured) for origin, measured in found.items()}
    here = rates.get("simulated", {})
    command = f"{RUN}robustness"
    return Claim(
        *claim,
        _rates(here) if here else missing(command),
        _rates(rates["measured"])
        if "measured" in rates
        else missing(f"{command} scene=fibre scene.path=FOLDER"),
        "a flipped bit of an exponent or a sign ruins a float32 number, one of 8 bits moves it by "
        "half of its range at most, and one of HDC's is one vote of D",
        _by_origin({origin: _tolerance(one) for origin, one in rates.items()})
        or "not decided: not measured yet",
    )


def _tolerated(measured: Measured) -> dict[str, dict[str, float]]:
    """By model, and kind of numbers, the largest bit error rate with hardly any loss."""
    result: dict[str, dict[str, float]] = {}
    found = disturbed(measured)
    for model in ("hdc", *LINEAR, "softmax"):
        for kind in FLIPS:
            clean = found.get(("none", 0.0), {}).get(model)
            levels = sorted(
                level for name, level in found if name == kind and model in found[name, level]
            )
            if clean is None or not levels:
                continue
            kept = 0.0
            for level in levels:
                if clean.value - found[kind, level][model].value > POINTS:
                    break
                kept = level
            result.setdefault(model, {})[kind] = kept
    return result


def _rates(found: Mapping[str, Mapping[str, float]]) -> str:
    names = dict(zip(FLIPS, ("as stored", "in 8 bits"), strict=True))
    return f"bit error rate that costs at most {100 * POINTS:g} points: " + "; ".join(
        f"{display_name(model)} "
        + ", ".join(f"{names[kind]} {_rate(rate)}" for kind, rate in kinds.items())
        for model, kinds in found.items()
    )


def _rate(rate: float) -> str:
    return "below all that were tried" if rate == 0 else f"{rate:g}"


def _tolerance(found: Mapping[str, Mapping[str, float]]) -> str:
    """By how many decades HDC tolerates more than the best rival, in either kind of numbers."""
    floats, bytes_ = (
        [kinds[kind] for model, kinds in found.items() if model != "hdc" and kind in kinds]
        for kind in FLIPS
    )
    if "hdc" not in found or not floats or not bytes_:
        return "not decided"
    hdc = found["hdc"][FLIPS[0]]
    # A rate of zero is one below all that were tried.
    gaps = [np.log10(max(hdc, 1e-9) / max(*rates, 1e-9)) for rates in (floats, bytes_)]
    if gaps[0] <= 0:
        return "does not hold"
    if gaps[1] <= 0:
        return "against float32 only: an effect of the number format"
    if gaps[1] < gaps[0] / 2:
        return "holds; mostly an effect of the number format"
    return "holds"


# Texture ------------------------------------------------------------------------------------------


def texture(results: Results) -> Claim:
    """Objects are told apart by touching them."""
    known = published.numbers()["tactile/test_accuracy"]
    names = {
        "tactile": "all",
        "tactile_texture": "texture alone",
        "tactile_depth": "thickness alone",
        PRECISE: "texture alone, the same patch pressed with ten times the precision",
    }
    groups = {scene: results.group(scene, "hdc") for scene in names}
    found = {scene: share(group) for scene, group in groups.items() if group.runs}
    commands = {"tactile": f"{RUN}scenes"}
    said = [
        f"{what}: {interval(*(percent(part) for part in found[scene]))} %"
        if scene in found
        else f"{what}: {missing(commands.get(scene, f'{RUN}tactile_controls'))}"
        for scene, what in names.items()
    ]
    chance = 1 / len(groups["tactile"].classes) if groups["tactile"].runs else None
    if chance is not None:
        said.append(f"chance {percent(chance)} %")
    return Claim(
        "Touched objects are recognised",
        f"{known.value:g} %: paper, sandpaper of grit 40 and 120 (Fig. 9(d))",
        "; ".join(said),
        "not measured: no speckle of touched textures is public (scene=recorded takes one's own)",
        "three sheets differ in thickness, so that the same approach presses them by different "
        "depths; the paper states neither thickness nor how precisely a touch was repeated, and "
        "both are assumed here",
        _recognised(found, chance),
    )


def _recognised(found: Mapping[str, Estimate], chance: float | None) -> str:
    if "tactile" not in found or chance is None:
        return "not decided: not measured yet"
    whole = found["tactile"]
    if not whole.low > chance:
        return "does not hold"
    if not {"tactile_texture", "tactile_depth"} <= set(found):
        return "objects: holds; by their texture: not decided"
    half = (chance + whole.value) / 2
    by_depth = found["tactile_depth"].value >= whole.value - POINTS
    if by_depth and found["tactile_texture"].value < half:
        text = "objects: holds; by their texture: does not hold, an effect of assumed thickness"
        if PRECISE in found and found[PRECISE].low >= half:
            text += ", but for touches repeated more precisely than assumed"
        return text
    return "objects: holds; by their texture: " + (
        "holds" if found["tactile_texture"].low >= half else "not decided"
    )


STUDY = Study(
    "claims",
    "The paper's claims",
    "What of the paper holds, on which light, and why?",
    0,
    tables,
    front=True,
)
