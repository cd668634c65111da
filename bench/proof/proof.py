# SPDX-License-Identifier: Apache-2.0
"""Claims, the measured values behind them, and the tables of the pages that show both.

bench/proof/claims.json says which benchmark measures a claim and where its values are in the benchmark's
JSON output. docs/results.json has one row a claim: values with unit, commit, date, machine, options.
A page shows the table NAME between the lines `<!-- proof:NAME -->` and `<!-- /proof:NAME -->`. Links in
claims.json start at the top of the tree. A claim may have a target, {"value": NAME, "at_least": NUMBER} or
"at_most"; the table then says whether it is met.

A row is *older* if git knows a later commit in the folders that the claim depends on (its module). Git may
not know: without history no row is older. Marks are therefore left out of comparisons.
"""

import fnmatch
import json
import pathlib
import posixpath
import re
import statistics
import string
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import bench_support  # noqa: E402

OLDER = "*older*, "
REDUCTIONS = {
    "median": statistics.median, "min": min, "max": max, "sum": sum, "all": all,
    "range": lambda values: [min(values), max(values)],
}


class ProofError(Exception):
    """A message for the user: what is wrong, and where."""


# --- values of a benchmark's output ---------------------------------------------------------------


def matches(name, pattern):
    return name == pattern or (isinstance(name, str) and isinstance(pattern, str) and fnmatch.fnmatchcase(name, pattern))


def children(node, step):
    """Nodes below `node` that one step of a path leads to. A step is the key of an object, a pattern of keys with
    `*`, `*` for all entries of a list, or an object of fields that the entries of a list must have."""
    if isinstance(step, dict):
        return [entry for entry in node if isinstance(entry, dict)
                and all(matches(entry.get(key), wanted) for key, wanted in step.items())] \
            if isinstance(node, list) else []
    if isinstance(node, list):
        return node if step == "*" else []
    if not isinstance(node, dict):
        return []
    return [node[step]] if step in node else [value for key, value in node.items() if matches(key, step)]


def read_value(document, spec):
    """The value that `spec` of a claim describes, in its unit."""
    found = [document]
    for step in spec["path"]:
        found = [child for node in found for child in children(node, step)]
        # A sum over keys of some kind may have none of them.
        if not found and not (spec.get("of") == "sum" and isinstance(step, str) and "*" in step):
            raise ProofError(f"nothing at {json.dumps(step)} of the path {json.dumps(spec['path'])}")
    if "of" in spec:
        values = [value for entry in found for value in (entry if isinstance(entry, list) else [entry])]
    else:
        values = found
        if len(values) != 1:
            raise ProofError(f"{len(values)} values at {json.dumps(spec['path'])}, not one")
    if any(not isinstance(value, (bool, int, float)) for value in values):
        raise ProofError(f"{json.dumps(spec['path'])} is no number")
    if "factor" in spec:
        values = [spec["factor"] * value for value in values]
    return REDUCTIONS[spec["of"]](values) if "of" in spec else values[0]


# --- sentences and tables -------------------------------------------------------------------------


class Sentence(string.Formatter):
    """str.format that writes a range as "3 to 5" and groups of thousands, format `_`, with spaces."""

    def __init__(self, claim):
        self.claim = claim

    def get_value(self, key, args, kwargs):
        value = kwargs[key]["value"]
        words = self.claim["values"][key].get("words")
        return words[str(value).lower()] if words else value

    def format_field(self, value, format_spec):
        parts = [format(part, format_spec).replace("_", " ") for part in (value if isinstance(value, list) else [value])]
        return " to ".join(dict.fromkeys(parts))


def measured(claim, row):
    """The sentence of the row's values."""
    try:
        return Sentence(claim).vformat(claim["measured"], (), row["values"])
    except (KeyError, TypeError, ValueError) as error:
        raise ProofError(f"its row does not fit \"measured\" of the claim: {error!r}") from error


def target(claim, row):
    """Whether the row meets the claim's target: "≥ 95 %: met"; empty without a target."""
    if "target" not in claim:
        return ""
    try:
        wanted = claim["target"]
        value, unit = row["values"][wanted["value"]]["value"], row["values"][wanted["value"]]["unit"]
        if "at_least" in wanted:
            sign, limit, met = "≥", wanted["at_least"], value >= wanted["at_least"]
        else:
            sign, limit, met = "≤", wanted["at_most"], value <= wanted["at_most"]
    except (KeyError, TypeError) as error:
        raise ProofError(f"its row does not fit \"target\" of the claim: {error!r}") from error
    return f"{sign} {limit:g}{'' if unit == '1' else f' {unit}'}: {'met' if met else '**missed**'}"


def links_from(page, text):
    """`text` with its links from the top of the tree as links from `page`."""
    return re.sub(r"\]\((?!\w+:|#)([^)#]+)",
                  lambda link: f"]({posixpath.relpath(link[1], posixpath.dirname(page) or '.')}", text)


def without_marks(text):
    return text.replace(OLDER, "")


class Proof:
    """The claims and results of a tree."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.results_file = self.root / "docs/results.json"
        document = self._read(self.root / "bench/proof/claims.json")
        self.claims, self.tables = document["claims"], document["tables"]
        self.rows = {}
        if self.results_file.exists():
            self.rows = {row["id"]: row for row in self._read(self.results_file)["rows"]}

    @staticmethod
    def _read(path):
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ProofError(f"{path}: {error}") from error

    def _git(self, *words):
        """What git prints, or None if it cannot say."""
        try:
            run = subprocess.run(["git", "-C", str(self.root), *words], capture_output=True, text=True, check=False)
        except OSError:
            return None
        return run.stdout.strip() if run.returncode == 0 else None

    def commit(self):
        return self._git("rev-parse", "--short=7", "HEAD")

    def uncommitted(self, claim_ids):
        """Files of the claims' modules that differ from the commit, or None if git cannot say."""
        folders = sorted({folder for claim_id in claim_ids for folder in self.claims[claim_id]["module"]})
        status = self._git("status", "--porcelain", "--", *folders)
        return None if status is None else [line.split(maxsplit=1)[-1] for line in status.splitlines()]

    def is_older(self, claim_id):
        row, claim = self.rows[claim_id], self.claims[claim_id]
        return bool(self._git("log", "-1", "--format=%h", f"{row['commit']}..HEAD", "--", *claim["module"]))

    def older(self):
        """Shown claims whose module has changed since they were measured."""
        return [claim_id for table in self.tables.values() for claim_id in table["claims"]
                if claim_id in self.rows and self.is_older(claim_id)]

    def record(self, claim_id, document, options, commit):
        """Puts the values of a benchmark's JSON output into docs/results.json."""
        claim = self.claims[claim_id]
        try:
            values = {name: {"value": read_value(document, spec), "unit": spec["unit"]}
                      for name, spec in claim["values"].items()}
        except ProofError as error:
            raise ProofError(f"{claim_id}: {error}") from error
        machine = dict(document.get("machine") or bench_support.machine())
        date = machine.pop("date")[:10]
        row = {"id": claim_id, "benchmark": claim["benchmark"], "options": options, "commit": commit, "date": date,
               "machine": machine, "values": values}
        measured(claim, row)
        self.rows[claim_id] = row
        rows = [self.rows[known] for known in self.claims if known in self.rows]
        rows += [row for known, row in self.rows.items() if known not in self.claims]
        self.results_file.write_text(json.dumps({"rows": rows}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return measured(claim, row)

    def table(self, name):
        claims = [self.claims[claim_id] for claim_id in self.tables[name]["claims"]]
        targets = any("target" in claim for claim in claims)
        columns = ["claim", "measured", *["target"] * targets, "date, commit", "repeat", "read"]
        lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
        for claim_id in self.tables[name]["claims"]:
            claim, row = self.claims[claim_id], self.rows[claim_id]
            mark = OLDER if self.is_older(claim_id) else ""
            cells = [claim["claim"], measured(claim, row), *[target(claim, row)] * targets,
                     f"{mark}{row['date']}, {row['commit']}", f"`{claim['benchmark']}`",
                     links_from(self.tables[name]["page"], claim["read"])]
            lines.append(f"| {' | '.join(cells)} |")
        return "\n".join(lines)

    def problems(self):
        """What is wrong with claims and rows themselves, as sentences."""
        found = []
        for name, table in self.tables.items():
            for claim_id in table["claims"]:
                if claim_id not in self.claims:
                    found.append(f"bench/proof/claims.json: table {name} names the claim {claim_id}, which is not there")
                elif claim_id not in self.rows:
                    found.append(f"docs/results.json has no row of the claim {claim_id}: bench/run "
                                 f"{self.claims[claim_id]['benchmark']} --record measures it")
                else:
                    try:
                        measured(self.claims[claim_id], self.rows[claim_id])
                        target(self.claims[claim_id], self.rows[claim_id])
                    except ProofError as error:
                        found.append(f"docs/results.json, {claim_id}: {error}")
        for claim_id, claim in self.claims.items():
            found += [f"bench/proof/claims.json, {claim_id}: there is no {folder}"
                      for folder in claim["module"] if not (self.root / folder).exists()]
        return found

    def pages(self):
        """Pairs of each page's path and its text with the tables as they should be."""
        texts = {}
        for name, table in self.tables.items():
            path = self.root / table["page"]
            text = texts.get(path) or path.read_text(encoding="utf-8")
            begin, end = f"<!-- proof:{name} -->\n", f"\n<!-- /proof:{name} -->"
            pattern = re.escape(begin) + "(?:.*?)" + re.escape(end)
            if len(re.findall(pattern, text, re.DOTALL)) != 1:
                raise ProofError(f"{table['page']}: has not one place between {begin.strip()} and {end.strip()}")
            generated = f"{begin}\n{self.table(name)}\n{end}"
            texts[path] = re.sub(pattern, lambda _, new=generated: new, text, flags=re.DOTALL)
        return list(texts.items())

    def stale_pages(self):
        """Pages whose tables say something else than the rows, whatever is marked as older."""
        return [path.relative_to(self.root).as_posix() for path, text in self.pages()
                if without_marks(path.read_text(encoding="utf-8")) != without_marks(text)]

    def write_pages(self):
        for path, text in self.pages():
            if path.read_text(encoding="utf-8") != text:
                path.write_text(text, encoding="utf-8")
