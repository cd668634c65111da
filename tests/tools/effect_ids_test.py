# SPDX-License-Identifier: Apache-2.0
"""Effects describe themselves: their ids stand in render_worker/effects and nowhere else in the sources.

The vocabulary is that of docs/effects.json, which effect_catalogue_is_fresh compares with the registry.
The ids of the diagnosis's model-discrepancy terms stand in render_worker/effects/discrepancy only.
"""

import json
import os
import pathlib
import re
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ("core", "coverage_server", "planner_client", "planning", "planning_service", "proto", "render_worker", "report",
           "rpc_server", "tools")
HOMES = ("render_worker/effects", "render_worker/effects/discrepancy")
SUFFIXES = (".cpp", ".h", ".proto", ".py", ".sh", ".js", ".mjs", ".html", ".txt", ".cmake", "")


def known_ids(root):
    """Ids of all effects and of all model-discrepancy terms."""
    vocabulary = json.loads((root / "docs/effects.json").read_text(encoding="utf-8"))
    ids = [effect["effect"] for effect in vocabulary["effects"]]
    for path in sorted((root / "render_worker/effects/discrepancy").glob("*.cpp")):
        ids += re.findall(r'\.id = "(unknown\.[a-z0-9_]+)"', path.read_text(encoding="utf-8"))
    return ids


def occurrences(root, ids):
    """Lines "file:number: text" of the sources that contain one of the ids as a whole word."""
    pattern = re.compile(r"(?<![\w.])(?:" + "|".join(map(re.escape, ids)) + r")(?!\w)")
    found = []
    for top in SOURCES:
        for folder, folders, files in os.walk(root / top):
            place = pathlib.Path(folder).relative_to(root)
            folders[:] = sorted(f for f in folders
                                if f != "node_modules" and (place / f).as_posix() not in HOMES)
            for name in sorted(files):
                if pathlib.Path(name).suffix not in SUFFIXES:
                    continue
                text = (pathlib.Path(folder) / name).read_text(encoding="utf-8", errors="replace")
                for number, line in enumerate(text.splitlines(), 1):
                    if pattern.search(line):
                        found.append(f"{place / name}:{number}: {line.strip()}")
    return found


class EffectIds(unittest.TestCase):

    def test_planted_ids_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in (("core/a.cpp", 'if (id == "optics.coma") return;\n// optics.coma_like\n'),
                               ("render_worker/effects/coma.cpp", '.id = "optics.coma"\n'),
                               ("render_worker/b.h", "frame.optics.coma = 1;\n"),
                               ("tests/c.cpp", '"optics.coma"\n')):
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text, encoding="utf-8")
            self.assertEqual(occurrences(root, ["optics.coma"]),
                             ['core/a.cpp:1: if (id == "optics.coma") return;'])

    def test_sources_name_no_effect(self):
        ids = known_ids(ROOT)
        self.assertGreater(len(ids), 100)
        self.assertEqual(occurrences(ROOT, ids), [])


if __name__ == "__main__":
    unittest.main()
