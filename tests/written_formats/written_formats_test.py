# SPDX-License-Identifier: Apache-2.0
"""written_formats_test.py WRITTEN_DOCUMENTS BINARIES MANUALS PACKAGES SOURCE

Every format that Sightline writes is valid for a program that others wrote. WRITTEN_DOCUMENTS is the
program that writes samples, BINARIES the folder of the programs, MANUALS the folder of the man pages,
PACKAGES one with node_modules of the package.json beside this file. The QIF schema is looked for in
SIGHTLINE_QIF_SCHEMA, then in SOURCE/../shared/data/qif_schema.

A new format joins by a line in VALIDATORS; a document of another writer by a line in
written_documents.cpp or in OTHER_DOCUMENTS. Debian packages are checked by lintian in
deploy/packages/test, which builds them.
"""

import csv
import glob
import gzip
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import yaml

PROGRAM, BINARIES, MANUALS, PACKAGES, SOURCE = sys.argv[1:6]
HERE = os.path.dirname(os.path.abspath(__file__))
TIME_LIMIT_S = 600


class Missing(Exception):
    """The validator or its schema is not on this machine."""


def run(*words, stdin=None):
    if not shutil.which(words[0]):
        raise Missing(f"{words[0]} is not installed (deploy/install-packages --tests)")
    done = subprocess.run(words, input=stdin, capture_output=True, check=False, timeout=TIME_LIMIT_S)
    return done.returncode, (done.stdout + done.stderr).decode("utf-8", "replace")


def fails(*words, stdin=None):
    """Nothing if the program accepts its input, what it says otherwise."""
    code, said = run(*words, stdin=stdin)
    return said or f"exit code {code}" if code != 0 else ""


def by_qif_schema(files):
    """XML Schema of QIF 3.0, by libxml2."""
    folders = [os.environ.get("SIGHTLINE_QIF_SCHEMA", ""), os.path.join(SOURCE, "../shared/data/qif_schema")]
    schema = next((path for path in (os.path.join(folder, "QIFDocument.xsd") for folder in folders if folder)
                   if os.path.isfile(path)), None)
    if schema is None:
        raise Missing("there is no QIF 3.0 schema; SIGHTLINE_QIF_SCHEMA names the folder of QIFDocument.xsd")
    return fails("xmllint", "--noout", "--schema", schema, *files)


def by_npm(files):
    """html-validate and axe-core, Khronos's glTF validator, the schema of OpenAPI."""
    code, said = run("node", os.path.join(HERE, "validate.mjs"), PACKAGES, *files)
    if code == 77:
        raise Missing(said)
    return said or f"exit code {code}" if code != 0 else ""


def by_json(files):
    """Python's json, without its extensions NaN and Infinity."""
    def refuse(constant):
        raise ValueError(f"{constant} is no JSON")
    for file in files:
        with open(file, encoding="utf-8") as stream:
            json.load(stream, parse_constant=refuse)
    return ""


def by_yaml(files):
    """PyYAML, as ROS reads it."""
    for file in files:
        with open(file, encoding="utf-8") as stream:
            if not list(yaml.safe_load_all(stream)):
                return f"{file}: is empty"
    return ""


def by_csv(files):
    """Python's csv: as many fields in every row as in the first."""
    for file in files:
        with open(file, encoding="utf-8", newline="") as stream:
            rows = list(csv.reader(stream, strict=True))
        if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
            return f"{file}: rows of different lengths, or none"
    return ""


def by_mandoc(files):
    """mandoc's linter."""
    for file in files:
        with gzip.open(file) as stream:
            said = fails("mandoc", "-T", "lint", "-W", "error", stdin=stream.read())
        if said:
            return f"{file}: {said}"
    return ""


def by_urdf(files):
    """The parser of ROS."""
    return "".join(fails("check_urdf", file) for file in files)


def by_ply_header(files):
    """Python alone: the header's elements are the bytes that follow, to the last."""
    sizes = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4, "double": 8}
    for file in files:
        with open(file, "rb") as stream:
            header, end, body = stream.read().partition(b"end_header\n")
        lines = [line.split() for line in header.decode("ascii").splitlines()]
        if not end or lines[0] != ["ply"] or ["format", "binary_little_endian", "1.0"] not in lines:
            return f"{file}: has no header of a binary PLY file"
        expected = count = 0
        for line in lines:
            if line[0] == "element":
                count = int(line[2])
            elif line[0] == "property" and line[1] != "list":
                expected += count * sizes[line[1]]
            elif line[0] == "property":
                return f"{file}: has lists"
        if expected != len(body):
            return f"{file}: has {len(body)} bytes of data, its header says {expected}"
    return ""


# How a name ends, and what checks such files. The first row that fits counts.
VALIDATORS = [
    (".qif", by_qif_schema),
    (".html", by_npm),
    (".glb", by_npm),
    (".openapi.json", by_npm),
    (".json", by_json),
    (".yaml", by_yaml),
    (".csv", by_csv),
    (".urdf", by_urdf),
    (".ply", by_ply_header),
    (".1.gz", by_mandoc),
]

# Documents that programs write, or that the source tree has: a pattern of files that are there, or the
# words of a program that writes {out}.
OTHER_DOCUMENTS = [
    os.path.join(MANUALS, "*.1.gz"),
    os.path.join(SOURCE, "examples/*/*.urdf"),
    os.path.join(SOURCE, "examples/*/*.glb"),
    os.path.join(SOURCE, "planner_client/explore/page/index.html"),
    ("plate.glb", [os.path.join(BINARIES, "sightline_step_import"),
                   os.path.join(SOURCE, "tests/tools/data/toleranced_plate.stp"), "--out", "{out}"]),
]


def validator_of(file):
    return next((check for end, check in VALIDATORS if file.endswith(end)), None)


class WrittenFormatsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        subprocess.run([PROGRAM, cls.folder.name], check=True, timeout=TIME_LIMIT_S)
        for document in OTHER_DOCUMENTS:
            if isinstance(document, str):
                found = glob.glob(document)
                if not found:
                    raise AssertionError(f"there is no {document}")
                for path in found:
                    name = "_".join(path.split(os.sep)[-2:])
                    shutil.copy(path, os.path.join(cls.folder.name, name))
            elif os.path.exists(document[1][0]):
                out = os.path.join(cls.folder.name, document[0])
                subprocess.run([word.format(out=out) for word in document[1]], check=True,
                               stdout=subprocess.DEVNULL, timeout=TIME_LIMIT_S)
        cls.files = sorted(os.path.join(cls.folder.name, name) for name in os.listdir(cls.folder.name))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_every_document_has_a_validator(self):
        self.assertEqual([file for file in self.files if validator_of(file) is None], [])

    def test_every_validator_has_a_document(self):
        used = {next(end for end, _ in VALIDATORS if file.endswith(end)) for file in self.files
                if validator_of(file)}
        self.assertEqual(used, {end for end, _ in VALIDATORS})

    def test_documents_are_valid(self):
        missing = []
        for check in dict.fromkeys(check for _, check in VALIDATORS):
            files = [file for file in self.files if validator_of(file) is check]
            with self.subTest(validator=check.__doc__):
                try:
                    self.assertEqual(check(files), "")
                except Missing as reason:
                    missing.append(str(reason))
        if missing:
            print("SKIPPED: " + "; ".join(missing))
            self.skipTest("; ".join(missing))

    # A validator that accepts everything would show nothing.
    def test_validators_find_what_is_wrong(self):
        damage = {
            "plan.qif": lambda text: text.replace(b"FormalStandardId", b"Formal"),
            "plan_report.html": lambda text: text.replace(b"</body>", b'<img src="a.png"><p role="nonsense"></p></body>'),
            "cylinder_head.glb": lambda text: text[:-4],
            "service.openapi.json": lambda text: text.replace(b"\"paths\"", b"\"path\""),
            "export_poses.json": lambda text: text + b"}",
            "export_transforms.yaml": lambda text: text + b"\n]: [",
            "plan.csv": lambda text: text + b"1\n",
            "turntable.urdf": lambda text: text.replace(b"</robot>", b""),
            "uncertainty.ply": lambda text: text + b"\0",
            "sightline.1.gz": lambda text: gzip.compress(b".so missing.1\n"),
        }
        for name, change in damage.items():
            file = next(file for file in self.files
                        if os.path.basename(file) == name or file.endswith("_" + name))
            check = validator_of(file)
            with open(file, "rb") as stream:
                text = change(stream.read())
            bad = os.path.join(self.folder.name, "damaged_" + os.path.basename(file))
            with open(bad, "wb") as stream:
                stream.write(text)
            with self.subTest(file=name):
                try:
                    said = check([bad])
                except Missing:
                    continue
                except (ValueError, csv.Error, yaml.YAMLError):
                    said = "refused"
                finally:
                    os.remove(bad)
                self.assertNotEqual(said, "", name)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
