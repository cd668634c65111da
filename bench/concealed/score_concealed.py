#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Opens the truth of concealed sets and scores the answers given without it.

    score_concealed.py OUT ANSWERS [--json FILE] [--markdown FILE]

OUT as make_concealed_sets wrote it, ANSWERS as run_concealed.py did (README.md).
"""

import argparse
import json
import math
import pathlib
import sys

LEVELS = (5, 20, 100)
# As `distinguishability` names them.
BINS_OF_D = ("< 3", "3-10", "> 10")
# Share of what the true effect changes that another must explain to be as right an answer.
EXPLAINED_SHARE = 0.98
# Remaining log-likelihood [nats] up to which recordings cannot tell an effect from the true one.
NOT_TOLD_APART = 2
# Probability that the set of answers is to hold.
SET_PROBABILITY = 0.9
UNKNOWN_KINDS = ("variant", "outside", "sealed")
STAGES = ("illumination", "surface", "optics", "geometry", "sensor", "time", "none", "unknown")


# --- statistics -----------------------------------------------------------------------------------


def binomial_cdf(k, n, p):
    """P(X <= k), X binomial."""
    if k < 0:
        return 0.0
    if k >= n:
        return 1.0
    if p <= 0:
        return 1.0
    if p >= 1:
        return 0.0
    total = 0.0
    for i in range(k + 1):
        log = math.lgamma(n + 1) - math.lgamma(i + 1) - math.lgamma(n - i + 1)
        total += math.exp(log + i * math.log(p) + (n - i) * math.log1p(-p))
    return min(1.0, total)


def _bisect(decreasing, target):
    low, high = 0.0, 1.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        if decreasing(middle) > target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def clopper_pearson(k, n, confidence=0.95):
    """Exact two-sided limits of a binomial probability (Clopper and Pearson 1934)."""
    if n == 0:
        return 0.0, 1.0
    tail = (1 - confidence) / 2
    lower = 0.0 if k == 0 else _bisect(lambda p: binomial_cdf(k - 1, n, p), 1 - tail)
    upper = 1.0 if k == n else _bisect(lambda p: binomial_cdf(k, n, p), tail)
    return lower, upper


def share(hits, number):
    low, high = clopper_pearson(hits, number)
    return {"hits": hits, "of": number, "share": hits / number if number else None,
            "lower_95": low, "upper_95": high}


def share_text(s):
    if not s["of"]:
        return "-"
    return (f"{s['hits']}/{s['of']} = {100 * s['share']:.1f} % "
            f"[{100 * s['lower_95']:.1f}, {100 * s['upper_95']:.1f}]")


def quantile(values, q):
    values = sorted(values)
    if not values:
        return None
    place = q * (len(values) - 1)
    low = int(place)
    high = min(low + 1, len(values) - 1)
    return values[low] + (place - low) * (values[high] - values[low])


# --- reading --------------------------------------------------------------------------------------


def read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def read_folder(folder):
    return {path.stem: read_json(path) for path in sorted(pathlib.Path(folder).glob("*.json"))
            if path.name not in ("times.json", "score.json")}


def with_equivalents(truth, proven):
    """The truth with what prove_equivalents found: `accepted` takes in what explains nearly all,
    `not_told_apart` what leaves too little for these recordings to tell."""
    effects = []
    for effect in truth["effects"]:
        accepted = list(effect["accepted"])
        near = []
        for name, explained in sorted(proven.items()):
            if name in accepted:
                continue
            if explained >= EXPLAINED_SHARE:
                accepted.append(name)
            elif isinstance(effect["gain_expected"], (int, float)) \
                    and (1 - explained) * effect["gain_expected"] < NOT_TOLD_APART:
                near.append(name)
        effects.append({**effect, "accepted": accepted, "not_told_apart": near})
    return {**truth, "effects": effects}


def ranked(answer):
    if answer is None or answer.get("failed"):
        return []
    return [entry for entry in answer.get("ranked", []) if entry.get("effect")]


def first(answer):
    entries = ranked(answer)
    return entries[0] if entries else None


def is_accusation(answer):
    """Says that something is missing from the null model."""
    if answer is None or answer.get("failed"):
        return False
    top = first(answer)
    if top is not None:
        return top["effect"] != "none"
    return answer.get("verdict") == "effect"


def stage_of(entry):
    if entry is None:
        return "failed"
    if entry.get("stage"):
        return entry["stage"]
    return entry["effect"].split(".")[0] if "." in entry["effect"] else entry["effect"]


def stages_said(answer):
    """Stages named by the answer, at most two; of older answers that of the first explanation."""
    said = (answer or {}).get("located_stages") or []
    top = first(answer)
    if not said and top is not None and top["effect"] != "none":
        said = [stage_of(top)]
    return said[:2]


def stages_accepted(effect):
    """Stages of all ids that count as right."""
    stages = {effect["stage"]}
    for name in effect["accepted"]:
        if "." in name:
            stages.add(name.split(".")[0])
    return stages


def set_of_answers(answer):
    """The explanations of the largest probabilities, as few as hold SET_PROBABILITY together; all of
    them if they hold less."""
    chosen, total = [], 0.0
    for entry in sorted(ranked(answer), key=lambda e: -float(e.get("probability", 0))):
        chosen.append(entry)
        total += float(entry.get("probability", 0))
        if total >= SET_PROBABILITY:
            break
    return chosen


def set_holds_truth(truth, answer):
    """Whether the set of answers holds an accepted one. Of laws outside the vocabulary that is
    `unknown` with a right stage among those said, or an equivalent effect."""
    effect = truth["effects"][0]
    for entry in set_of_answers(answer):
        if entry["effect"] == "unknown":
            if truth["kind"] in UNKNOWN_KINDS and stages_accepted(effect) & (
                    {stage_of(entry)} | set(stages_said(answer))):
                return True
        elif entry["effect"] in effect["accepted"]:
            return True
    return False


def claims(answer):
    """The effects claimed: those of the first explanation, and what is said to be beside it."""
    top = first(answer)
    if top is None:
        return []
    return [top] + list(answer.get("also_present", []) or [])


def excess_removed(effect, answer):
    """Part of the held-out excess chi squared that the model takes away: the excess is what the
    refitted null model is expected to leave beyond the true one, twice the expected gain. None:
    not known, or not said."""
    full = (answer or {}).get("full") or {}
    held_out = (answer or {}).get("held_out_improvement") or full.get("held_out_improvement") or {}
    gain = effect["gain_expected"]
    try:
        null, model = float(held_out["null"]), float(held_out["with_effect"])
        degrees = float(full["model_fit"]["degrees_of_freedom"])
    except (KeyError, TypeError, ValueError):
        return None
    if not isinstance(gain, (int, float)) or gain <= 0:
        return None
    return (null - model) * degrees / (2 * gain)


def model_p_value(answer):
    """Probability of the held-out data's chi squared under the model: of the recordings marked as
    held out if they are listed, else that of the model's fit."""
    full = (answer or {}).get("full") or {}
    fit = full.get("model_fit") or {}
    chi_squared = degrees = 0.0
    for recording in fit.get("recordings", []) or []:
        if recording.get("held_out"):
            chi_squared += float(recording.get("chi_squared", 0))
            degrees += float(recording.get("degrees_of_freedom", 0))
    if degrees > 0:
        return chi_squared_tail(chi_squared, degrees)
    if "p_value" in fit:
        return float(fit["p_value"])
    return None


def chi_squared_tail(x, degrees):
    """Upper tail of the chi squared distribution: regularised incomplete gamma function by its
    series or continued fraction (Abramowitz and Stegun 6.5.29, 6.5.31)."""
    a, x = 0.5 * degrees, 0.5 * x
    if x <= 0:
        return 1.0
    log_factor = a * math.log(x) - x - math.lgamma(a)
    if x < a + 1:
        term = total = 1 / a
        n = a
        while abs(term) > 1e-15 * abs(total):
            n += 1
            term *= x / n
            total += term
        return max(0.0, 1 - math.exp(log_factor) * total)
    tiny = 1e-300
    b = x + 1 - a
    c = 1 / tiny
    d = 1 / b
    fraction = d
    for i in range(1, 10000):
        an = -i * (i - a)
        b += 2
        d = 1 / (an * d + b or tiny)
        c = b + an / c or tiny
        step = d * c
        fraction *= step
        if abs(step - 1) < 1e-14:
            break
    return min(1.0, math.exp(log_factor) * fraction)


# --- scores ---------------------------------------------------------------------------------------


def score_nulls(truths, answers):
    groups = {}
    for size in ("all", "small", "full"):
        sets = [t for t in truths if t["kind"] == "null"
                and (size == "all" or t.get("small", False) == (size == "small"))]
        answered = [t for t in sets if ranked(answers.get(t["set"]))]
        accused = [t["set"] for t in answered if is_accusation(answers[t["set"]])]
        groups[size] = {"accused": share(len(accused), len(answered)), "sets": accused,
                        "failed": len(sets) - len(answered)}
    return groups


def score_singles(truths, answers):
    """By gain level; failures count as wrong."""
    result = {}
    for level in (*LEVELS, "20 and 100"):
        wanted = LEVELS[1:] if level == "20 and 100" else (level,)
        sets = [t for t in truths if t["kind"] == "single"
                and t["effects"][0]["gain_level"] in wanted]
        found = stage = top = three = 0
        for t in sets:
            effect = t["effects"][0]
            answer = answers.get(t["set"])
            entries = ranked(answer)
            found += is_accusation(answer)
            stage += bool(entries) and stage_of(entries[0]) in stages_accepted(effect)
            top += bool(entries) and entries[0]["effect"] in effect["accepted"]
            three += any(e["effect"] in effect["accepted"] for e in entries[:3])
        n = len(sets)
        result[str(level)] = {"found": share(found, n), "stage": share(stage, n),
                              "first": share(top, n), "first_three": share(three, n)}
    return result


def score_pairs(truths, answers, kind="pair"):
    """Both: each effect is claimed. One: at least one is. Extra: a claim that is neither."""
    sets = [t for t in truths if t["kind"] == kind]
    found = one = both = extra = stage = 0
    for t in sets:
        answer = answers.get(t["set"])
        ids = [c["effect"] for c in claims(answer)]
        found += is_accusation(answer)
        hits = [any(i in e["accepted"] for i in ids) for e in t["effects"]]
        one += any(hits)
        both += all(hits)
        extra += any(i not in ("none", "unknown")
                     and not any(i in e["accepted"] for e in t["effects"]) for i in ids)
        stage += first(answer) is not None and any(
            stage_of(first(answer)) in stages_accepted(e) for e in t["effects"])
    n = len(sets)
    return {"found": share(found, n), "one": share(one, n), "both": share(both, n),
            "wrong_claim": share(extra, n), "stage_of_one": share(stage, n)}


def score_strong(truths, answers):
    """Strong effects of the vocabulary: named first, or rejected as unknown."""
    sets = [t for t in truths if t["kind"] == "strong"]
    tops = [(first(answers.get(t["set"])), t["effects"][0]) for t in sets]
    named = sum(top is not None and top["effect"] in e["accepted"] for top, e in tops)
    unknown = sum(top is not None and top["effect"] == "unknown" for top, _ in tops)
    return {"first": share(named, len(sets)), "unknown": share(unknown, len(sets))}


def right_without_module(effect, answer, removed, near=False):
    """`unknown` at the right stage, or a proven equivalent that was not taken away; `near`: or what
    the recordings cannot tell from the truth."""
    top = first(answer)
    if top is None:
        return False
    if top["effect"] == "unknown":
        return stage_of(top) in stages_accepted(effect)
    accepted = effect["accepted"] + (effect.get("not_told_apart", []) if near else [])
    return top["effect"] in accepted and top["effect"] not in removed


def score_without_module(cases):
    """`cases`: (truth effect, answer, ids taken away) of variant laws or leave-one-out runs."""
    result = {}
    for level in (*LEVELS, "all"):
        chosen = [c for c in cases if level == "all" or c[0]["gain_level"] == level]
        found = named = named_near = improved = both = half_of = named_wrong = said = 0
        for effect, answer, removed in chosen:
            good = right_without_module(effect, answer, removed)
            part = excess_removed(effect, answer)
            top = first(answer)
            named_near += right_without_module(effect, answer, removed, near=True)
            found += is_accusation(answer)
            said += bool(stages_accepted(effect) & set(stages_said(answer)))
            named += good
            named_wrong += top is not None and top["effect"] not in ("none", "unknown") and not good
            half_of += part is not None
            improved += part is not None and part >= 0.5
            both += good and part is not None and part >= 0.5
        n = len(chosen)
        result[str(level)] = {"found": share(found, n), "answered_right": share(named, n),
                              "answered_right_or_near": share(named_near, n),
                              "wrong_name": share(named_wrong, n),
                              "stages_said": share(said, n),
                              "half_of_excess_removed": share(improved, half_of),
                              "right_and_improved": share(both, n)}
    return result


def score_by_distinguishability(truths, answers, measured):
    """The rates by bins of D, the log-likelihood that the nearest other explanation loses
    (`distinguishability` OUT). Known: single and strong effects of the vocabulary; unknown: variants
    and laws outside it. `measured`: by set."""
    result = {}
    for bin_of_d in BINS_OF_D:
        inside = [t for t in truths if measured.get(t["set"], {}).get("bin") == bin_of_d]
        known = [t for t in inside if t["kind"] in ("single", "strong")]
        unknown = [t for t in inside if t["kind"] in UNKNOWN_KINDS]
        tops = [(first(answers.get(t["set"])), t["effects"][0]) for t in known]
        parts = [excess_removed(t["effects"][0], answers.get(t["set"])) for t in unknown]
        parts = [part for part in parts if part is not None]
        named = sum(top is not None and top["effect"] in e["accepted"] for top, e in tops)
        rejected = sum(top is not None and top["effect"] == "unknown" for top, _ in tops)
        said = sum(bool(stages_accepted(t["effects"][0]) & set(stages_said(answers.get(t["set"]))))
                   for t in unknown)
        right = sum(_is_unknown_at_right_stages(t["effects"][0], answers.get(t["set"]))
                    for t in unknown)
        both = known + unknown
        held = sum(set_holds_truth(t, answers.get(t["set"])) for t in both)
        sizes = [len(set_of_answers(answers.get(t["set"]))) for t in both]
        result[bin_of_d] = {
            "set_holds_truth": share(held, len(both)), "median_set_size": quantile(sizes, 0.5),
            "known_named": share(named, len(known)), "known_called_unknown": share(rejected, len(known)),
            "unknown_right": share(right, len(unknown)), "unknown_stage_said": share(said, len(unknown)),
            "half_of_excess_removed": share(sum(p >= 0.5 for p in parts), len(parts))}
    return result


def _is_unknown_at_right_stages(effect, answer):
    """`unknown` with the right stage among the at most two that are said, or an equivalent name."""
    top = first(answer)
    if top is not None and top["effect"] == "unknown":
        return bool(stages_accepted(effect) & set(stages_said(answer)))
    return right_without_module(effect, answer, [])


def confusion(truths, answers, label_truth, label_answer):
    table = {}
    for t in truths:
        row = table.setdefault(label_truth(t), {})
        column = label_answer(t, answers.get(t["set"]))
        row[column] = row.get(column, 0) + 1
    return table


def calibration(truths, answers, bins=10):
    """Every probability given to an explanation against whether it is right. A set's log score is
    that of the sum of the probabilities of right answers."""
    pairs = []
    log_scores = []
    tops = []
    for t in truths:
        if t["kind"] == "pair":
            continue
        right = {"none"} if t["is_null"] else set(t["effects"][0]["accepted"])
        entries = ranked(answers.get(t["set"]))
        if not entries:
            continue
        total = 0.0
        for k, entry in enumerate(entries):
            p = min(1.0, max(0.0, float(entry.get("probability", 0))))
            hit = entry["effect"] in right
            pairs.append((p, hit))
            if k == 0:
                tops.append((p, hit))
            if hit:
                total += p
        # The class is right, whichever of its members: their probabilities belong together.
        log_scores.append(math.log(max(1e-6, min(1.0, total))))

    def reliability(values):
        rows = []
        for b in range(bins):
            inside = [(p, h) for p, h in values
                      if b / bins <= p < (b + 1) / bins or (b == bins - 1 and p == 1)]
            if inside:
                rows.append({"from": b / bins, "to": (b + 1) / bins, "number": len(inside),
                             "mean_probability": sum(p for p, _ in inside) / len(inside),
                             "right": share(sum(h for _, h in inside), len(inside))})
        return rows

    def brier(values):
        return sum((p - h) ** 2 for p, h in values) / len(values) if values else None

    return {"all": reliability(pairs), "first": reliability(tops), "brier_all": brier(pairs),
            "brier_first": brier(tops),
            "mean_log_score": sum(log_scores) / len(log_scores) if log_scores else None,
            "sets": len(log_scores)}


def detection_limits(truths, answers):
    """By effect: least expected gain that was found, largest that was not, and what the tool itself
    says is detectable (strength at a gain of 5)."""
    rows = {}
    for t in truths:
        if t["kind"] != "single":
            continue
        effect = t["effects"][0]
        row = rows.setdefault(effect["effect"], {"sets": 0, "found": 0, "named": 0,
                                                 "least_gain_found": None,
                                                 "largest_gain_missed": None,
                                                 "least_gain_named": None, "stated_over_true": []})
        answer = answers.get(t["set"])
        gain = effect["gain_expected"]
        row["sets"] += 1
        found = is_accusation(answer)
        top = first(answer)
        named = top is not None and top["effect"] in effect["accepted"]
        row["found"] += found
        row["named"] += named
        if isinstance(gain, (int, float)):
            def update(key, better):
                old = row[key]
                row[key] = gain if old is None else better(old, gain)

            if found:
                update("least_gain_found", min)
            else:
                update("largest_gain_missed", max)
            if named:
                update("least_gain_named", min)
        for power in ((answer or {}).get("full") or {}).get("power", []) or []:
            true = effect["parameters"].get(power.get("parameter"))
            if power.get("effect") == effect["effect"] and true and isinstance(gain, (int, float)):
                # Strength at a gain of 5, from the gain of the true one, where the gain grows with
                # the square of the strength; of parameters whose null value is 0.
                if not power["parameter"].endswith("factor") and gain > 0:
                    row["stated_over_true"].append(
                        abs(float(power["strength"])) / (abs(true) * math.sqrt(5 / gain)))
    for row in rows.values():
        row["stated_over_true"] = quantile(row["stated_over_true"], 0.5)
    return rows


def parameter_errors(truths, answers):
    """Of effects that were named themselves, not by an equivalent."""
    rows = []
    for t in truths:
        if t["kind"] != "single":
            continue
        effect = t["effects"][0]
        top = first(answers.get(t["set"]))
        if top is None or top["effect"] != effect["effect"]:
            continue
        for name, true in effect["parameters"].items():
            fitted = (top.get("parameters") or {}).get(name)
            # A phase is beyond what is drawn for the camera, which answers cannot know.
            if fitted is None or name == "fringe_phase_deg":
                continue
            error = (top.get("standard_errors") or {}).get(name)
            null = 1.0 if name.endswith("factor") or name in ("m2", "modes") else 0.0
            scale = abs(true - null)
            rows.append({"set": t["set"], "effect": effect["effect"], "parameter": name,
                         "gain_level": effect["gain_level"], "true": true, "fitted": fitted,
                         "z": (fitted - true) / error if error else None,
                         "relative_error": abs(fitted - true) / scale if scale > 0 else None})
    zs = [r["z"] for r in rows if r["z"] is not None]
    strong = [r["relative_error"] for r in rows
              if r["gain_level"] >= 20 and r["relative_error"] is not None]
    return {"rows": rows, "with_error": len(zs),
            "within_2": share(sum(abs(z) <= 2 for z in zs), len(zs)),
            "within_3": share(sum(abs(z) <= 3 for z in zs), len(zs)),
            "median_abs_z": quantile([abs(z) for z in zs], 0.5),
            "median_relative_error": quantile(strong, 0.5),
            "within_20_percent": share(sum(e <= 0.2 for e in strong), len(strong))}


def score_fit(truths, answers):
    """Singles of the vocabulary at gains of 20 and 100: what is left in the held-out data."""
    sets = [t for t in truths if t["kind"] == "single" and t["effects"][0]["gain_level"] >= 20]
    ps = [model_p_value(answers.get(t["set"])) for t in sets]
    every = [t for t in truths if t["kind"] == "single"]
    all_ps = [model_p_value(answers.get(t["set"])) for t in every]
    parts = [excess_removed(t["effects"][0], answers.get(t["set"])) for t in sets]
    parts = [p for p in parts if p is not None]
    return {"not_rejected": share(sum(p is not None and p > 0.01 for p in all_ps), len(all_ps)),
            "not_rejected_20_100": share(sum(p is not None and p > 0.01 for p in ps), len(ps)),
            "without_p_value": sum(p is None for p in all_ps),
            "median_excess_removed": quantile(parts, 0.5),
            "half_of_excess_removed": share(sum(p >= 0.5 for p in parts), len(parts))}


def score(out, answers_folder):
    out, answers_folder = pathlib.Path(out), pathlib.Path(answers_folder)
    answers = read_folder(answers_folder)
    proven = answers.pop("equivalents", {})
    truths = [with_equivalents(truth, proven.get(truth["set"], {}))
              for _, truth in sorted(read_folder(out / "truth").items())]
    asked = [t for t in truths if t["set"] in answers]
    result = {"sets": len(truths), "answered": len(asked),
              "failed": [t["set"] for t in asked if answers[t["set"]].get("failed")]}
    result["nulls"] = score_nulls(asked, answers)
    result["singles"] = score_singles(asked, answers)
    result["pairs"] = score_pairs(asked, answers)
    result["strong"] = score_strong(asked, answers)
    result["strong_pairs"] = score_pairs(asked, answers, "strong_pair")
    result["variants"] = score_without_module(
        [(t["effects"][0], answers[t["set"]], []) for t in asked if t["kind"] == "variant"])
    for kind in ("outside", "sealed"):
        result[kind] = score_without_module(
            [(t["effects"][0], answers[t["set"]], []) for t in asked if t["kind"] == kind])
    left_out = []
    by_name = {t["set"]: t for t in truths}
    again = read_folder(answers_folder / "leave_one_out")
    if (out / "leave_one_out.json").exists():
        for case in read_json(out / "leave_one_out.json"):
            if case["set"] in again:
                left_out.append((by_name[case["set"]]["effects"][0], again[case["set"]],
                                 case["exclude"]))
    result["leave_one_out"] = score_without_module(left_out)

    measured = out / "distinguishability.json"
    result["distinguishability"] = score_by_distinguishability(
        asked, answers, read_json(measured) if measured.exists() else {})

    def true_stage(t):
        return "none" if t["is_null"] else t["effects"][0]["stage"]

    def true_name(t):
        return "none" if t["is_null"] else t["effects"][0]["effect"]

    def answered_stage(t, answer):
        return stage_of(first(answer))

    def answered_name(t, answer):
        top = first(answer)
        if top is None:
            return "failed"
        if top["effect"] == "unknown":
            return "unknown at " + stage_of(top)
        if not t["is_null"] and top["effect"] != t["effects"][0]["effect"] \
                and top["effect"] in t["effects"][0]["accepted"]:
            return top["effect"] + " (accepted)"
        return top["effect"]

    singles_and_nulls = [t for t in asked if t["kind"] in ("null", "single")]
    result["confusion_stages"] = confusion(singles_and_nulls, answers, true_stage, answered_stage)
    result["confusion_names"] = confusion(
        [t for t in asked if t["kind"] == "single" and t["effects"][0]["gain_level"] >= 20],
        answers,
        true_name, answered_name)
    result["confusion_variants"] = confusion([t for t in asked if t["kind"] == "variant"], answers,
                                             true_name, answered_name)
    result["calibration"] = calibration(asked, answers)
    result["detection"] = detection_limits(asked, answers)
    result["parameters"] = parameter_errors(asked, answers)
    result["fit"] = score_fit(asked, answers)
    seconds = [a["seconds"] for a in answers.values() if isinstance(a.get("seconds"), (int, float))]
    result["seconds"] = {"median": quantile(seconds, 0.5), "largest": max(seconds, default=None)}
    return result


# --- printing -------------------------------------------------------------------------------------


def number(value, digits=3):
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return str(value)


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return lines


def confusion_rows(matrix, columns):
    return [[row] + [str(matrix[row].get(c, "")) for c in columns] for row in sorted(matrix)]


def report(result):
    lines = ["# Concealed sets", "",
             f"{result['answered']} of {result['sets']} sets answered, {len(result['failed'])} of "
             f"them failed. Time: median {number(result['seconds']['median'])} s, largest "
             f"{number(result['seconds']['largest'])} s. Limits in brackets: 95 %, Clopper and "
             "Pearson.", "", "## Nulls", ""]
    lines += table(["sets", "accused", "failed", "which"],
                   [[size, share_text(g["accused"]), str(g["failed"]), ", ".join(g["sets"]) or "-"]
                    for size, g in result["nulls"].items()])
    lines += ["", "## Single effects of the vocabulary, by expected log-likelihood gain", ""]
    lines += table(["gain", "found", "stage right", "accepted name first", "among the first three"],
                   [[level] + [share_text(g[k]) for k in ("found", "stage", "first", "first_three")]
                    for level, g in result["singles"].items()])
    strong = result["strong"]
    lines += ["", "## Strong effects", ""]
    lines += table(["named first", "called unknown"],
                   [[share_text(strong[k]) for k in ("first", "unknown")]])
    for key, title in (("pairs", "Pairs"), ("strong_pairs", "Pairs of strong effects")):
        pairs = result[key]
        lines += ["", f"## {title}", ""]
        lines += table(["found", "one named", "both named", "a wrong one named",
                        "stage of one first"],
                       [[share_text(pairs[k])
                         for k in ("found", "one", "both", "wrong_claim", "stage_of_one")]])
    for key, title in (("variants", "Variant laws"), ("outside", "Laws outside the vocabulary"),
                       ("sealed", "Sealed laws outside the vocabulary"),
                       ("leave_one_out", "Leave-one-out")):
        lines += ["", f"## {title}", ""]
        lines += table(["gain", "found", "unknown or equivalent at the right stage",
                        "or not to be told apart", "right stage among at most two said",
                        "a wrong effect named", "half of held-out excess removed (where said)",
                        "both"],
                       [[level] + [share_text(g[k]) for k in
                                   ("found", "answered_right", "answered_right_or_near",
                                    "stages_said", "wrong_name", "half_of_excess_removed",
                                    "right_and_improved")]
                        for level, g in result[key].items()])
    lines += ["", "## By distinguishability D, in nats (bench/concealed/README.md)", ""]
    lines += table(["D", "known effect named first", "known effect called unknown",
                    "outside law: unknown or equivalent, right stage among at most two",
                    "right stage among at most two said", "half of held-out excess removed",
                    f"set of {SET_PROBABILITY:.0%} holds the truth", "its median size"],
                   [[bin_of_d] + [share_text(g[k]) for k in
                                  ("known_named", "known_called_unknown", "unknown_right",
                                   "unknown_stage_said", "half_of_excess_removed",
                                   "set_holds_truth")] + [number(g["median_set_size"])]
                    for bin_of_d, g in result["distinguishability"].items()])
    fit = result["fit"]
    lines += ["", "## Fit after the model is added", "",
              f"Held-out fit not rejected (p > 0.01): {share_text(fit['not_rejected'])} of all "
              f"singles, {share_text(fit['not_rejected_20_100'])} at gains of 20 and 100 "
              f"({fit['without_p_value']} without a p-value). Held-out excess removed at gains of "
              f"20 and 100: median {number(fit['median_excess_removed'])}, at least half in "
              f"{share_text(fit['half_of_excess_removed'])}."]
    p = result["parameters"]
    lines += ["", "## Parameters", "",
              f"{len(p['rows'])} fitted, {p['with_error']} with a standard error. |z| <= 2: "
              f"{share_text(p['within_2'])}; |z| <= 3: {share_text(p['within_3'])}; median |z| "
              f"{number(p['median_abs_z'])} (normal: 0.674). Gains of 20 and 100: median relative "
              f"error {number(p['median_relative_error'])}, within 20 %: "
              f"{share_text(p['within_20_percent'])}.", ""]
    lines += table(["effect", "parameter", "gain", "true", "fitted", "z", "relative error"],
                   [[r["effect"], r["parameter"], str(r["gain_level"]), number(r["true"]),
                     number(r["fitted"]), number(r["z"]), number(r["relative_error"])]
                    for r in sorted(p["rows"], key=lambda r: (r["effect"], r["parameter"],
                                                              r["gain_level"], r["set"]))])
    columns = [s for s in STAGES] + ["failed"]
    lines += ["", "## Stages (rows: truth, nulls and singles)", ""]
    lines += table(["truth"] + columns, confusion_rows(result["confusion_stages"], columns))
    for key, title in (("confusion_names", "Names (singles at gains of 20 and 100)"),
                       ("confusion_variants", "Names given to variant laws")):
        lines += ["", f"## {title}", ""]
        lines += table(["truth", "answers"],
                       [[row, ", ".join(f"{name} {n}" for name, n in
                                        sorted(cells.items(), key=lambda c: (-c[1], c[0])))]
                        for row, cells in sorted(result[key].items())])
    c = result["calibration"]
    lines += ["", "## Calibration", "",
              f"{c['sets']} sets without pairs. Brier score {number(c['brier_all'])} over all "
              f"explanations, {number(c['brier_first'])} over first ones; mean log score "
              f"{number(c['mean_log_score'])}.", ""]
    lines += table(["probability of the first", "sets", "mean", "right"],
                   [[f"{r['from']:.1f}-{r['to']:.1f}", str(r["number"]),
                     number(r["mean_probability"]), share_text(r["right"])] for r in c["first"]])
    lines += [""]
    lines += table(["probability of any", "explanations", "mean", "right"],
                   [[f"{r['from']:.1f}-{r['to']:.1f}", str(r["number"]),
                     number(r["mean_probability"]), share_text(r["right"])] for r in c["all"]])
    lines += ["", "## Detection limits by effect (expected gain)", ""]
    lines += table(["effect", "sets", "found", "named", "least gain found", "largest gain missed",
                    "least gain named", "stated limit over true one"],
                   [[name, str(r["sets"]), str(r["found"]), str(r["named"]),
                     number(r["least_gain_found"]), number(r["largest_gain_missed"]),
                     number(r["least_gain_named"]), number(r["stated_over_true"])]
                    for name, r in sorted(result["detection"].items())])
    return "\n".join(lines) + "\n"


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("out", metavar="OUT")
    parser.add_argument("answers", metavar="ANSWERS")
    parser.add_argument("--json", help="default: ANSWERS/score.json")
    parser.add_argument("--markdown", help="the same text into a file")
    options = parser.parse_args(arguments)
    if not (pathlib.Path(options.out) / "truth").is_dir():
        sys.exit(f"score_concealed: {options.out}/truth: no such folder")
    if not pathlib.Path(options.answers).is_dir():
        sys.exit(f"score_concealed: {options.answers}: no such folder")
    result = score(options.out, options.answers)
    text = report(result)
    print(text, end="")
    path = pathlib.Path(options.json or pathlib.Path(options.answers) / "score.json")
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if options.markdown:
        pathlib.Path(options.markdown).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
