# SPDX-License-Identifier: Apache-2.0
"""tools/proof_table and the recording of bench/run on trees of their own; the claims of this tree."""

import importlib.machinery
import importlib.util
import json
import pathlib
import re
import string
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "bench/proof"))
import proof  # noqa: E402

CLAIMS = {
    "tables": {"claims": {"page": "README.md", "claims": ["speed", "scans"]}},
    "claims": {
        "speed": {
            "claim": "queries are fast", "measured": "{rate:_.0f} queries/s, {kind}", "read": "[page](page.md)",
            "benchmark": "queries", "options": "--seconds 3", "proof_minutes": 1, "module": ["engine"],
            "values": {"rate": {"path": ["results", "peers", {"name": "ours*"}, "rate"], "unit": "1/s"},
                       "kind": {"path": ["results", "peers", "*", "ok"], "of": "all", "unit": "ok",
                                "words": {"true": "all right", "false": "some wrong"}}}},
        "scans": {
            "claim": "plans need few scans", "measured": "{scans:.0f} scans", "read": "", "benchmark": "plans",
            "options": "", "module": ["planner"],
            "values": {"scans": {"path": ["results", "*", "scans"], "of": "range", "unit": "scans"}}},
    },
}
SPEED = {"machine": {"cpu": "CPU", "cores": 2, "date": "2026-01-02T03:04:05Z"},
         "results": {"peers": [{"name": "ours, fast", "rate": 28288.4, "ok": True}, {"name": "theirs", "rate": 1, "ok": True}]}}
SCANS = {"machine": {"cpu": "CPU", "cores": 2, "date": "2026-01-03T00:00:00Z"}, "results": [{"scans": 16}, {"scans": 18}]}
PAGE = "# A page\n\n<!-- proof:claims -->\n\n<!-- /proof:claims -->\n\nmore\n"


def load(path):
    loader = importlib.machinery.SourceFileLoader(path.name, str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(path.name, loader))
    loader.exec_module(module)
    return module


class ValuesTest(unittest.TestCase):
    def read(self, *path, **spec):
        document = {"list": [{"case": "a, 1", "x": 3, "seeds": [5, 7, 9]}, {"case": "a, 2", "x": 4}, {"case": "b", "x": 5}],
                    "kills": {"job": 2, "sightline serve": 1}}
        return proof.read_value(document, {"path": list(path), **spec})

    def test_paths(self):
        self.assertEqual(5, self.read("list", {"case": "b"}, "x"))
        self.assertEqual(7, self.read("list", {"case": "a, 1"}, "seeds", of="median"))
        self.assertEqual(300, self.read("list", {"case": "a,*"}, "x", of="min", factor=100))
        self.assertEqual([3, 5], self.read("list", "*", "x", of="range"))
        self.assertEqual(3, self.read("kills", "*", of="sum"))
        self.assertEqual(1, self.read("kills", "*serve*", of="sum"))
        # None of that kind was killed.
        self.assertEqual(0, self.read("kills", "*worker*", of="sum"))

    def test_paths_that_lead_nowhere(self):
        for path, spec in ((["lst", "*", "x"], {"of": "sum"}), (["list", {"case": "c"}, "x"], {"of": "sum"}),
                           (["list", "*", "y"], {"of": "max"}), (["list", "*", "x"], {}), (["list", {"case": "b"}, "case"], {})):
            with self.assertRaises(proof.ProofError, msg=path):
                self.read(*path, **spec)


class TreeTest(unittest.TestCase):
    """A tree with two claims, at first without history."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name) / "tree"
        for name, text in (("bench/proof/claims.json", json.dumps(CLAIMS)), ("README.md", PAGE), ("docs/page.md", ""),
                           ("engine/a.cpp", "1"), ("planner/a.cpp", "1"), (".gitignore", "*.tmp")):
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            (self.root / name).write_text(text)

    def git(self, *words, at=None):
        identity = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "init.defaultBranch=main",
                    "-c", "commit.gpgsign=false"]
        run = subprocess.run(["git", *identity, "-C", at or self.root, *words], check=True, capture_output=True, text=True)
        return run.stdout.strip()

    def commit(self, change=None):
        if change:
            (self.root / change).write_text("changed")
        else:
            self.git("init", "-q")
        self.git("add", "-A")
        self.git("commit", "-q", "-m", "Change")
        return self.git("rev-parse", "--short=7", "HEAD")

    def record(self, commit="1234567"):
        tree = proof.Proof(self.root)
        self.assertEqual("28 288 queries/s, all right", tree.record("speed", SPEED, "--seconds 3", commit))
        self.assertEqual("16 to 18 scans", tree.record("scans", SCANS, "", commit))

    def run_tool(self, *words, root=None):
        return subprocess.run([sys.executable, ROOT / "tools/proof_table", "--root", root or self.root, *words],
                              capture_output=True, text=True)

    def page(self):
        return (self.root / "README.md").read_text()

    def test_a_claim_without_a_row_fails(self):
        check = self.run_tool("--check")
        self.assertEqual(1, check.returncode)
        self.assertIn("no row of the claim speed: bench/run queries --record measures it", check.stderr)
        self.record()
        rows = proof.Proof(self.root).rows
        self.assertEqual({"id": "speed", "benchmark": "queries", "options": "--seconds 3", "commit": "1234567",
                          "date": "2026-01-02", "machine": {"cpu": "CPU", "cores": 2},
                          "values": {"rate": {"value": 28288.4, "unit": "1/s"}, "kind": {"value": True, "unit": "ok"}}},
                         rows["speed"])
        # A value that the sentence needs is missing as well.
        (self.root / "docs/results.json").write_text(json.dumps({"rows": [rows["speed"], {**rows["scans"], "values": {}}]}))
        check = self.run_tool("--check")
        self.assertEqual(1, check.returncode)
        self.assertIn("docs/results.json, scans: its row does not fit", check.stderr)

    def test_a_tree_without_history(self):
        self.record()
        self.assertEqual(1, self.run_tool("--check").returncode)  # the page has no table yet
        self.assertEqual(0, self.run_tool().returncode)
        self.assertIn("| plans need few scans | 16 to 18 scans | 2026-01-03, 1234567 | `plans` |  |\n", self.page())
        self.assertTrue(self.page().endswith("\n<!-- /proof:claims -->\n\nmore\n"))
        check = self.run_tool("--check")
        self.assertEqual((0, ""), (check.returncode, check.stderr))
        self.assertIn("older than their module: none", check.stdout)
        (self.root / "README.md").write_text(self.page().replace("16 to 18", "15 to 18"))
        check = self.run_tool("--check")
        self.assertEqual(1, check.returncode)
        self.assertIn("README.md: its table is not that of docs/results.json", check.stderr)

    def test_a_table_with_targets_in_a_folder(self):
        claims = json.loads(json.dumps(CLAIMS))
        claims["tables"]["more"] = {"page": "docs/page.md", "claims": ["speed", "scans", "least"]}
        claims["claims"]["speed"].update(target={"value": "rate", "at_least": 30000},
                                         read="[top](README.md#a-page), [web](https://a.b/c)")
        least = {**claims["claims"]["scans"], "claim": "one plan needs few scans", "target": {"value": "scans", "at_most": 16}}
        least["values"] = {"scans": {**least["values"]["scans"], "of": "min"}}
        claims["claims"]["least"] = least
        (self.root / "bench/proof/claims.json").write_text(json.dumps(claims))
        (self.root / "docs/page.md").write_text(PAGE.replace("proof:claims", "proof:more"))
        self.record()
        proof.Proof(self.root).record("least", SCANS, "", "1234567")
        self.assertEqual(0, self.run_tool().returncode)
        table = (self.root / "docs/page.md").read_text()
        self.assertIn("| claim | measured | target | date, commit | repeat | read |\n", table)
        self.assertIn("| ≥ 30000 1/s: **missed** | 2026-01-02, 1234567 | `queries` "
                      "| [top](../README.md#a-page), [web](https://a.b/c) |\n", table)
        self.assertIn("| plans need few scans | 16 to 18 scans |  | 2026", table)
        self.assertIn("| 16 scans | ≤ 16 scans: met | 2026", table)
        # The same claim in the table of a page at the top: its link needs no way up.
        self.assertIn("| [top](README.md#a-page), [web](https://a.b/c) |\n", self.page())
        claims["claims"]["speed"]["target"]["value"] = "sped"
        (self.root / "bench/proof/claims.json").write_text(json.dumps(claims))
        self.assertIn("its row does not fit \"target\"", self.run_tool("--check").stderr)

    def test_rows_of_a_changed_module_are_older(self):
        self.record(self.commit())
        self.run_tool()
        self.assertNotIn("older", self.page())
        self.commit("docs/page.md")  # belongs to no module
        self.assertIn("older than their module: none", self.run_tool("--check").stdout)
        self.commit("engine/a.cpp")
        check = self.run_tool("--check")
        # Stale marks are no failure.
        self.assertEqual(0, check.returncode)
        self.assertIn("older than their module: speed\n", check.stdout)
        self.run_tool()
        self.assertIn("| 28 288 queries/s, all right | *older*, 2026-01-02, ", self.page())
        self.assertIn("| 16 to 18 scans | 2026-01-03, ", self.page())
        # A clone of the last commit alone knows of no earlier change.
        self.commit("docs/page.md")
        shallow = self.root.parent / "shallow"
        self.git("clone", "-q", "--depth", "1", f"file://{self.root}", str(shallow))
        check = self.run_tool("--check", root=shallow)
        self.assertEqual((0, ""), (check.returncode, check.stderr))

    def test_what_cannot_be_recorded(self):
        output = self.root / "speed.tmp"
        output.write_text(json.dumps(SPEED))
        words = ("--record", "speed", "--json", output)
        self.assertIn("git knows none", self.run_tool(*words).stderr)
        self.commit()
        (self.root / "engine/a.cpp").write_text("2")
        self.assertIn("engine/a.cpp is not committed", self.run_tool(*words).stderr)
        self.assertEqual({}, proof.Proof(self.root).rows)
        commit = self.commit("engine/a.cpp")
        self.assertIn("speed: 28 288 queries/s, all right", self.run_tool(*words).stdout)
        self.assertEqual(("--seconds 3", commit), (proof.Proof(self.root).rows["speed"]["options"],
                                                   proof.Proof(self.root).rows["speed"]["commit"]))
        output.write_text(json.dumps({**SPEED, "results": {"peers": []}}))
        self.assertIn("speed: nothing at {\"name\": \"ours*\"}", self.run_tool(*words).stderr)
        self.assertEqual(2, self.run_tool("--record", "sped", "--json", output).returncode)
        self.assertEqual(2, self.run_tool("--record", "speed").returncode)

    def test_a_module_that_is_gone(self):
        self.record()
        (self.root / "planner/a.cpp").unlink()
        (self.root / "planner").rmdir()
        self.assertIn("bench/proof/claims.json, scans: there is no planner", self.run_tool("--check").stderr)


class RunTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.bench_run = load(ROOT / "bench/run")
        cls.proof = proof.Proof(ROOT)

    def test_claims_of_this_tree(self):
        for claim_id, claim in self.proof.claims.items():
            with self.subTest(claim_id):
                self.assertIn(claim["benchmark"], [*self.bench_run.NAMES, "concealed"])
                names = {name for _, name, _, _ in string.Formatter().parse(claim["measured"]) if name}
                self.assertEqual(names, set(claim["values"]))

    def test_the_proof_takes_an_hour_at_most(self):
        self.assertLess(sum(claim.get("proof_minutes", 0) for claim in self.proof.claims.values()), 60)

    def test_every_benchmark_has_a_target(self):
        text = "\n".join(path.read_text() for path in (ROOT / "bench").rglob("CMakeLists.txt"))
        for name in self.bench_run.NAMES:
            loops = re.search(rf"foreach\(name [^)]*\b{name}\b[^)]*\)\s*sightline_benchmark(_script)?\(\$\{{name\}}", text)
            self.assertTrue(loops or re.search(rf"sightline_benchmark(_script)?\({name}[ )]", text), name)
        for script in self.bench_run.SCRIPTS.values():
            self.assertTrue((ROOT / script).is_file(), script)

    def test_runs(self):
        def runs(*words):
            return self.bench_run.planned_runs(self.bench_run.read_arguments(list(words), self.proof), self.proof)

        self.assertEqual([("strategies", ["--seeds", "2"], [])], runs("strategies", "--", "--seeds", "2"))
        self.assertEqual([("emva1288", [], ["sensor"])], runs("emva1288", "--record"))
        self.assertEqual([("emva1288", ["--seed", "3"], ["sensor"])], runs("--record", "emva1288", "--", "--seed", "3"))
        proven = {name for name, *_ in runs("--proof")}
        self.assertIn("fast_vs_exact", proven)
        self.assertNotIn("planning_faults", proven)
        self.assertNotIn("strategies", {name for name, *_ in runs()})

    def test_folders_without_benchmarks_are_configured_again(self):
        self.assertEqual([], self.bench_run.reconfiguration("A:BOOL=ON\nSIGHTLINE_BUILD_BENCH:BOOL=ON\n"))
        self.assertEqual(["-DSIGHTLINE_BUILD_BENCH=ON"], self.bench_run.reconfiguration("SIGHTLINE_BUILD_BENCH:BOOL=OFF\n"))
        self.assertEqual(
            ["-DSIGHTLINE_BUILD_BENCH=ON", "-DSIGHTLINE_PROGRAMS=plan;render;serve;render-worker;step-import"],
            self.bench_run.reconfiguration("SIGHTLINE_BUILD_BENCH:BOOL=OFF\nSIGHTLINE_PROGRAMS:STRING=plan;step-import\n"))


if __name__ == "__main__":
    unittest.main()
