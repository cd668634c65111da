// SPDX-License-Identifier: Apache-2.0
// Checks manifests of batch/v1 Jobs against the schemas of Kubernetes; fields that these do not have
// are errors.
//   NODE_PATH=.../node_modules node check_manifest.cjs FILE...
"use strict";
const fs = require("node:fs");
const registry = require("@kubernetes-models/validate");

const register = registry.register;
registry.register = (id, schema) =>
  register(id, schema.properties ? { additionalProperties: false, ...schema } : schema);
const { Job } = require("kubernetes-models/batch/v1");

for (const file of process.argv.slice(2)) {
  try {
    new Job(JSON.parse(fs.readFileSync(file, "utf8"))).validate();
  } catch (error) {
    console.error(`${file}: ${error.message}`);
    process.exitCode = 1;
  }
}
