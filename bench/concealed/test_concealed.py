# SPDX-License-Identifier: Apache-2.0
"""Scorer and runner on made-up truth and answers; the generator's bytes."""

import filecmp
import json
import os
import pathlib
import random
import stat
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import run_concealed  # noqa: E402
import score_concealed as score  # noqa: E402

BIN = os.environ.get("SIGHTLINE_BIN_DIR")


def effect(name, level, stage=None, accepted=None, **parameters):
    return {"effect": name, "stage": stage or name.split(".")[0], "gain_level": level,
            "gain_expected": float(level), "accepted": accepted or [name], "parameters": parameters}


def answer(*entries, held_out=None, also=(), p_value=None, degrees_of_freedom=100):
    result = {"verdict": "none" if entries[0][0] == "none" else "effect",
              "ranked": [{"effect": e[0], "stage": e[1], "probability": e[2],
                          **(e[3] if len(e) > 3 else {})} for e in entries],
              "also_present": list(also)}
    if held_out:
        result["held_out_improvement"] = {"null": held_out[0], "with_effect": held_out[1]}
    result["full"] = {"model_fit": {"degrees_of_freedom": degrees_of_freedom}}
    if p_value is not None:
        result["full"]["model_fit"]["p_value"] = p_value
    return result


class Statistics(unittest.TestCase):
    def test_clopper_pearson(self):
        # None of n: upper limit 1 - (alpha/2)^(1/n).
        low, high = score.clopper_pearson(0, 200)
        self.assertEqual(low, 0)
        self.assertAlmostEqual(high, 1 - 0.025 ** (1 / 200), places=12)
        low, high = score.clopper_pearson(200, 200)
        self.assertAlmostEqual(low, 0.025 ** (1 / 200), places=12)
        self.assertEqual(high, 1)
        # Textbook: 4 of 20 gives (0.0573, 0.4366).
        low, high = score.clopper_pearson(4, 20)
        self.assertAlmostEqual(low, 0.0573, places=4)
        self.assertAlmostEqual(high, 0.4366, places=4)
        self.assertEqual(score.clopper_pearson(0, 0), (0.0, 1.0))

    def test_limits_cover(self):
        # Exact limits hold for every probability.
        for p in (0.01, 0.1, 0.45):
            covered = 0.0
            for k in range(31):
                low, high = score.clopper_pearson(k, 30)
                if low <= p <= high:
                    covered += score.binomial_cdf(k, 30, p) - score.binomial_cdf(k - 1, 30, p)
            self.assertGreaterEqual(covered, 0.95)

    def test_chi_squared_tail(self):
        self.assertAlmostEqual(score.chi_squared_tail(3.841459, 1), 0.05, places=6)
        self.assertAlmostEqual(score.chi_squared_tail(18.307038, 10), 0.05, places=6)
        self.assertAlmostEqual(score.chi_squared_tail(2, 2), 0.36787944117, places=9)
        self.assertAlmostEqual(score.chi_squared_tail(1000, 1000), 0.4940, places=3)


class Scores(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.out = pathlib.Path(self.folder.name) / "out"
        self.answers = pathlib.Path(self.folder.name) / "answers"
        (self.out / "truth").mkdir(parents=True)
        (self.answers / "leave_one_out").mkdir(parents=True)

    def tearDown(self):
        self.folder.cleanup()

    def add(self, name, kind, effects, given, small=False, again=None, exclude=None):
        truth = {"set": name, "kind": kind, "is_null": kind == "null", "small": small,
                 "effects": effects}
        (self.out / "truth" / f"{name}.json").write_text(json.dumps(truth))
        if given is not None:
            (self.answers / f"{name}.json").write_text(json.dumps(given))
        if again is not None:
            (self.answers / "leave_one_out" / f"{name}.json").write_text(json.dumps(again))
            path = self.out / "leave_one_out.json"
            cases = json.loads(path.read_text()) if path.exists() else []
            cases.append({"set": name, "exclude": exclude})
            path.write_text(json.dumps(cases))

    def score(self):
        result = score.score(self.out, self.answers)
        self.assertIn("# Concealed sets", score.report(result))
        return result

    def test_nulls(self):
        for k in range(10):
            self.add(f"set_{k}", "null", [], answer(("none", "none", 0.9)), small=k < 6)
        self.add("set_a", "null", [], answer(("sensor.prnu", "sensor", 0.6), ("none", "none", 0.4)))
        self.add("set_f", "null", [], {"failed": "exit code 1"})
        self.add("set_n", "null", [], None)
        nulls = self.score()["nulls"]
        self.assertEqual((nulls["all"]["accused"]["hits"], nulls["all"]["accused"]["of"]), (1, 11))
        self.assertEqual(nulls["all"]["failed"], 1)
        self.assertEqual(nulls["small"]["accused"]["of"], 6)
        self.assertEqual(nulls["full"]["sets"], ["set_a"])

    def test_singles(self):
        amplitude = ["surface.albedo_error", "illumination.power_error"]
        self.add("set_0", "single", [effect("surface.albedo_error", 20, accepted=amplitude)],
                 answer(("illumination.power_error", "illumination", 0.5)))
        self.add("set_1", "single", [effect("sensor.dark_current", 20)],
                 answer(("sensor.black_level_error", "sensor", 0.6), ("none", "none", 0.2),
                        ("sensor.dark_current", "sensor", 0.1)))
        self.add("set_2", "single", [effect("optics.coma", 100)],
                 answer(("none", "none", 0.6), ("a.b", "a", 0.1), ("c.d", "c", 0.1),
                        ("optics.coma", "optics", 0.05)))
        self.add("set_3", "single", [effect("optics.coma", 100)], {"failed": "timeout"})
        singles = self.score()["singles"]
        row = singles["20"]
        self.assertEqual([row[k]["hits"] for k in ("found", "stage", "first", "first_three")],
                         [2, 2, 1, 2])
        row = singles["100"]
        self.assertEqual([row[k]["hits"] for k in ("found", "stage", "first", "first_three")],
                         [0, 0, 0, 0])
        self.assertEqual(singles["20 and 100"]["first"]["of"], 4)

    def test_variants_and_leave_one_out(self):
        ring = effect("variant.ring_halo", 20, "optics", ["unknown"])
        forty = {"degrees_of_freedom": 40}  # an expected excess of 1 for each
        good = answer(("unknown", "optics", 0.8), held_out=(2.0, 1.2), **forty)
        weak = answer(("unknown", "optics", 0.8), held_out=(2.0, 1.8), **forty)
        wrong_stage = answer(("unknown", "sensor", 0.8), held_out=(2.0, 1.2), **forty)
        named = answer(("optics.veiling_glare", "optics", 0.8), held_out=(2.0, 1.1), **forty)
        for k, given in enumerate((good, weak, wrong_stage, named)):
            self.add(f"set_{k}", "variant", [ring], given)
        truth = effect("surface.albedo_error", 100,
                       accepted=["surface.albedo_error", "illumination.power_error",
                                 "optics.transmission_error"])
        removed = ["surface.albedo_error", "illumination.power_error"]
        self.add("set_8", "single", [truth], answer(("surface.albedo_error", "surface", 0.9)),
                 again=answer(("optics.transmission_error", "optics", 0.9), held_out=(3, 1)),
                 exclude=removed)
        self.add("set_9", "single", [truth], answer(("surface.albedo_error", "surface", 0.9)),
                 again=answer(("illumination.power_error", "illumination", 0.9), held_out=(3, 1)),
                 exclude=removed)
        result = self.score()
        row = result["variants"]["20"]
        self.assertEqual([row[k]["hits"] for k in ("answered_right", "wrong_name",
                                                   "half_of_excess_removed", "right_and_improved")],
                         [2, 1, 3, 1])
        row = result["leave_one_out"]["all"]
        # An effect that was taken away cannot be the answer.
        self.assertEqual((row["answered_right"]["hits"], row["answered_right"]["of"]), (1, 2))

    def test_strong_effects_and_laws_outside(self):
        dark = effect("sensor.dark_current", 100)
        coma = effect("optics.coma", 100)
        self.add("set_0", "strong", [dark], answer(("sensor.dark_current", "sensor", 0.9)))
        self.add("set_1", "strong", [dark], answer(("unknown", "sensor", 0.9)))
        self.add("set_2", "strong_pair", [dark, coma], answer(("optics.coma", "optics", 0.9)))
        law = effect("outside.column_slew", 20, "sensor", ["unknown"])
        self.add("set_3", "outside", [law], answer(("unknown", "sensor", 0.9)))
        self.add("set_4", "sealed", [law], answer(("unknown", "optics", 0.9)))
        result = self.score()
        self.assertEqual([result["strong"][k]["hits"] for k in ("first", "unknown")], [1, 1])
        pairs = result["strong_pairs"]
        self.assertEqual([pairs[k]["hits"] for k in ("one", "both")], [1, 0])
        self.assertEqual(result["pairs"]["one"]["of"], 0)
        self.assertEqual(result["outside"]["all"]["answered_right"]["hits"], 1)
        sealed = result["sealed"]["all"]["answered_right"]
        self.assertEqual((sealed["hits"], sealed["of"]), (0, 1))

    def test_stages_said(self):
        law = effect("outside.column_slew", 20, "sensor", ["unknown"])
        said = (["sensor"], ["optics", "sensor"], ["optics", "time", "sensor"], None)
        for k, stages in enumerate(said):
            given = answer(("unknown", "optics" if stages else "sensor", 0.9))
            if stages:
                given["located_stages"] = stages
            self.add(f"set_{k}", "outside", [law], given)
        self.add("set_4", "outside", [law], answer(("none", "none", 0.9)))
        row = self.score()["outside"]["all"]["stages_said"]
        # A third stage does not count; without the field the stage of the first explanation does.
        self.assertEqual((row["hits"], row["of"]), (3, 5))

    def test_rates_by_distinguishability(self):
        law = effect("outside.a", 100, stage="sensor", accepted=["unknown"])
        truths = [{"set": "s1", "kind": "single", "effects": [effect("optics.coma", 100)]},
                  {"set": "s2", "kind": "strong", "effects": [effect("optics.coma", 100)]},
                  {"set": "s3", "kind": "outside", "effects": [law]},
                  {"set": "s4", "kind": "outside", "effects": [law]}]
        two = answer(("unknown", "optics", 0.9), held_out=(3, 1))
        two["located_stages"] = ["optics", "sensor"]
        answers = {"s1": answer(("optics.coma", "optics", 0.9)),
                   "s2": answer(("unknown", "optics", 0.9)), "s3": two,
                   "s4": answer(("time.stage_speed", "time", 0.9))}
        measured = {"s1": {"bin": "> 10"}, "s2": {"bin": "> 10"}, "s3": {"bin": "> 10"},
                    "s4": {"bin": "< 3"}}
        rates = score.score_by_distinguishability(truths, answers, measured)
        hits = {d: {name: (g["hits"], g["of"]) for name, g in rates[d].items()
                    if name != "median_set_size"} for d in rates}
        self.assertEqual({"set_holds_truth": (2, 3), "known_named": (1, 2), "known_called_unknown": (1, 2),
                          "unknown_right": (1, 1), "unknown_stage_said": (1, 1),
                          "half_of_excess_removed": (1, 1)}, hits["> 10"])
        self.assertEqual((0, 1), hits["< 3"]["unknown_right"])
        self.assertEqual((0, 0), hits["3-10"]["unknown_right"])

    def test_the_set_of_answers_is_as_small_as_may_be(self):
        given = answer(("optics.coma", "optics", 0.6), ("time.stage_speed", "time", 0.1),
                       ("unknown", "sensor", 0.29))
        self.assertEqual([0.6, 0.29, 0.1],
                         [entry["probability"] for entry in score.set_of_answers(given)])
        given = answer(("optics.coma", "optics", 0.6), ("unknown", "sensor", 0.35))
        law = {"kind": "outside", "effects": [effect("outside.a", 20, "sensor", ["unknown"])]}
        self.assertTrue(score.set_holds_truth(law, given))
        # `unknown` is no right answer where the vocabulary has the effect.
        known = {"kind": "single", "effects": [effect("sensor.prnu", 20)]}
        self.assertFalse(score.set_holds_truth(known, given))

    def test_proven_equivalents(self):
        linear = effect("variant.linear_power_drift", 20, "illumination", ["unknown"])
        for k in range(3):
            self.add(f"set_{k}", "variant", [linear],
                     answer(("illumination.power_drift", "illumination", 0.9), held_out=(2, 1)))
        # Left of 20 nats: 0.2, 1, 4.
        proven = {f"set_{k}": {"illumination.power_drift": share}
                  for k, share in enumerate((0.99, 0.95, 0.8))}
        (self.answers / "equivalents.json").write_text(json.dumps(proven))
        row = self.score()["variants"]["20"]
        self.assertEqual([row[k]["hits"] for k in ("answered_right", "answered_right_or_near")],
                         [1, 2])

    def test_pairs(self):
        both = [effect("optics.coma", 20), effect("sensor.prnu", 20)]
        self.add("set_0", "pair", both, answer(
            ("sensor.prnu", "sensor", 0.9), also=[{"effect": "optics.coma", "stage": "optics"}]))
        self.add("set_1", "pair", both, answer(
            ("sensor.prnu", "sensor", 0.9), also=[{"effect": "optics.dust", "stage": "optics"}]))
        self.add("set_2", "pair", both, answer(("none", "none", 0.9)))
        pairs = self.score()["pairs"]
        self.assertEqual([pairs[k]["hits"] for k in ("found", "one", "both", "wrong_claim")],
                         [2, 2, 1, 1])

    def test_parameters_and_fit(self):
        self.add("set_0", "single", [effect("sensor.dark_current", 100,
                                            dark_current_electrons_per_s=20.0)],
                 answer(("sensor.dark_current", "sensor", 0.9,
                         {"parameters": {"dark_current_electrons_per_s": 22.0},
                          "standard_errors": {"dark_current_electrons_per_s": 1.0}}),
                        held_out=(3.0, 1.0), p_value=0.3))
        self.add("set_1", "single", [effect("optics.f_number_error", 100, f_number_factor=0.8)],
                 answer(("optics.f_number_error", "optics", 0.9,
                         {"parameters": {"f_number_factor": 0.7},
                          "standard_errors": {"f_number_factor": 0.02}}), p_value=0.001))
        result = self.score()
        rows = {r["parameter"]: r for r in result["parameters"]["rows"]}
        self.assertAlmostEqual(rows["dark_current_electrons_per_s"]["z"], 2)
        self.assertAlmostEqual(rows["dark_current_electrons_per_s"]["relative_error"], 0.1)
        self.assertAlmostEqual(rows["f_number_factor"]["z"], -5)
        self.assertAlmostEqual(rows["f_number_factor"]["relative_error"], 0.5)
        self.assertEqual(result["fit"]["not_rejected"]["hits"], 1)
        self.assertAlmostEqual(result["fit"]["median_excess_removed"], 1)

    def test_calibration(self):
        draw = random.Random(1)
        for k in range(400):
            p = draw.random()
            right = draw.random() < p
            given = answer(("none" if right else "sensor.prnu", "none" if right else "sensor", p),
                           ("sensor.prnu" if right else "none", "sensor" if right else "none",
                            1 - p))
            self.add(f"set_{k:03}", "null", [], given)
        calibration = self.score()["calibration"]
        # Honest probabilities: every bin's limits hold its mean (99.9 %: none is far off).
        for row in calibration["first"]:
            low, high = score.clopper_pearson(row["right"]["hits"], row["number"], 0.999)
            self.assertTrue(low <= row["mean_probability"] <= high, row)
        # E[(p - h)^2] = E[p (1 - p)] = 1/6, standard error 0.2/sqrt(400).
        self.assertAlmostEqual(calibration["brier_first"], 1 / 6, delta=0.03)


class Runs(unittest.TestCase):
    def test_resumes_and_notes_failures(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for name in ("set_1", "set_2", "set_3"):
                (folder / "out/sets" / name).mkdir(parents=True)
                (folder / "out/sets" / name / "recordings.json").write_text("{}")
            (folder / "out/leave_one_out.json").write_text(
                json.dumps([{"set": "set_1", "exclude": ["a.b", "c.d"]}]))
            program = folder / "sightline"
            program.write_text(
                "#!/usr/bin/env python3\n"
                "import json, pathlib, sys, time\n"
                "set_folder = pathlib.Path(sys.argv[2])\n"
                "out = pathlib.Path(sys.argv[sys.argv.index('--out') + 1])\n"
                "if set_folder.name == 'set_2': sys.exit('error: broken')\n"
                "if set_folder.name == 'set_3': time.sleep(60)\n"
                "answer = {'set': set_folder.name, 'arguments': sys.argv[5:]}\n"
                "(out / 'diagnosis.json').write_text(json.dumps(answer))\n"
                "(out / 'diagnosis_full.json').write_text('{\"seed\": 1, \"profiles\": [1]}')\n")
            program.chmod(program.stat().st_mode | stat.S_IXUSR)
            arguments = [str(folder / "out"), str(folder / "answers"), "--sightline", str(program),
                         "--timeout", "3"]
            quiet = open(os.devnull, "w", encoding="utf-8")
            shown, sys.stdout = sys.stdout, quiet
            try:
                run_concealed.main([*arguments, "--limit", "1"])
                first = (folder / "answers/set_1.json").read_bytes()
                run_concealed.main([*arguments, "--jobs", "2"])
            finally:
                sys.stdout = shown
                quiet.close()
            self.assertEqual((folder / "answers/set_1.json").read_bytes(), first)
            read = lambda name: json.loads((folder / "answers" / name).read_text())
            self.assertEqual(read("set_1.json")["full"], {"seed": 1})
            self.assertIn("broken", read("set_2.json")["failed"])
            self.assertIn("not done within", read("set_3.json")["failed"])
            self.assertEqual(read("leave_one_out/set_1.json")["arguments"],
                             ["--exclude", "a.b", "--exclude", "c.d"])
            self.assertEqual(len(read("times.json")), 4)


@unittest.skipUnless(BIN and (pathlib.Path(BIN) / "make_concealed_sets").exists(),
                     "make_concealed_sets is not built")
class Generator(unittest.TestCase):
    def test_same_seed_same_bytes(self):
        with tempfile.TemporaryDirectory() as folder:
            for name, threads in (("a", "1"), ("b", "2")):
                subprocess.run([str(pathlib.Path(BIN) / "make_concealed_sets"), f"{folder}/{name}",
                                "--seed", "5", "--nulls", "2", "--small-nulls", "--threads",
                                threads], check=True, stdout=subprocess.DEVNULL)
            files = sorted(str(p.relative_to(f"{folder}/a"))
                           for p in pathlib.Path(folder, "a").rglob("*") if p.is_file())
            self.assertGreater(len(files), 20)
            match, mismatch, errors = filecmp.cmpfiles(f"{folder}/a", f"{folder}/b", files,
                                                       shallow=False)
            self.assertEqual((mismatch, errors), ([], []))
            self.assertEqual(len(match), len(files))
            # A set's folder holds only what an engineer would state.
            for path in pathlib.Path(folder, "a/sets").rglob("*"):
                if path.is_file():
                    self.assertNotIn(b"nuisance", path.read_bytes())


if __name__ == "__main__":
    unittest.main()
