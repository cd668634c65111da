// SPDX-License-Identifier: Apache-2.0
// Checks a task.json against the service's contract before it is sent: the library that makes messages
// of it drops fields that it does not know, and bends values of another type.

const MAX_DEPTH = 64;
const WHOLE = {TYPE_INT32: [-(2 ** 31), 2 ** 31 - 1], TYPE_UINT32: [0, 2 ** 32 - 1],
  TYPE_INT64: [Number.MIN_SAFE_INTEGER, Number.MAX_SAFE_INTEGER], TYPE_UINT64: [0, Number.MAX_SAFE_INTEGER]};

// `contract`: package definition of @grpc/proto-loader with names as in the .proto files. Throws an
// Error that names the field and what it must be.
export function checkTask(contract, task) {
  checkMessage(contract, [contract['sightline.v1.PlanningTask'].type], task, 'task.json', 0);
}

function fail(place, reason) {
  throw new Error(`${place}: ${reason}`);
}

// The message or enumeration of that name, as seen from the innermost of `scopes`, and the scopes it
// has itself. Names are relative to the scope that they are used in, or to the package.
function resolve(contract, scopes, name) {
  for (let depth = scopes.length; depth > 0; depth--) {
    let found = [scopes[depth - 1]];
    for (const part of name.split('.')) {
      const outer = found.at(-1);
      const inner = [...outer?.nestedType ?? [], ...outer?.enumType ?? []].find((type) => type.name === part);
      found = [...found, inner];
    }
    if (found.at(-1)) return [...scopes.slice(0, depth - 1), ...found];
  }
  const [first, ...rest] = name.replace(/^\.?(sightline\.v1\.)?/, '').split('.');
  const outer = [contract[`sightline.v1.${first}`].type];
  return rest.length > 0 ? resolve(contract, outer, rest.join('.')) : outer;
}

function checkMessage(contract, scopes, value, place, depth) {
  const type = scopes.at(-1);
  if (depth > MAX_DEPTH) fail(place, `is nested more than ${MAX_DEPTH} deep`);
  if (typeof value !== 'object' || value === null || Array.isArray(value)) fail(place, 'must be an object');
  for (const [key, item] of Object.entries(value)) {
    const here = depth === 0 ? `${place}: ${key}` : `${place}.${key}`;
    const field = type.field.find((candidate) => candidate.name === key);
    if (!field) fail(here, `is no field of ${type.name}`);
    if (field.label !== 'LABEL_REPEATED') {
      checkValue(contract, scopes, field, item, here, depth);
      continue;
    }
    const entry = field.type === 'TYPE_MESSAGE' ? resolve(contract, scopes, field.typeName).at(-1) : null;
    if (entry?.options?.mapEntry) {
      const of_value = entry.field.find((candidate) => candidate.name === 'value');
      if (typeof item !== 'object' || item === null || Array.isArray(item)) fail(here, 'must be an object');
      for (const [name, of_name] of Object.entries(item)) checkValue(contract, scopes, of_value, of_name, `${here}.${name}`, depth);
      continue;
    }
    if (!Array.isArray(item)) fail(here, 'must be a list');
    item.forEach((element, i) => checkValue(contract, scopes, field, element, `${here}[${i}]`, depth));
  }
}

function checkValue(contract, scopes, field, value, place, depth) {
  if (field.type === 'TYPE_MESSAGE') {
    checkMessage(contract, resolve(contract, scopes, field.typeName), value, place, depth + 1);
  } else if (field.type === 'TYPE_ENUM') {
    const names = resolve(contract, scopes, field.typeName).at(-1).value.map((known) => known.name);
    if (!names.includes(value)) fail(place, `is ${JSON.stringify(value)}, must be one of ${names.join(', ')}`);
  } else if (field.type === 'TYPE_BOOL') {
    if (typeof value !== 'boolean') fail(place, `is ${JSON.stringify(value)}, must be true or false`);
  } else if (field.type === 'TYPE_STRING' || field.type === 'TYPE_BYTES') {
    if (typeof value !== 'string') fail(place, `is ${JSON.stringify(value)}, must be a text`);
  } else if (field.type === 'TYPE_DOUBLE' || field.type === 'TYPE_FLOAT') {
    if (typeof value !== 'number') fail(place, `is ${JSON.stringify(value)}, must be a number`);
  } else {
    const [least, most] = WHOLE[field.type];
    const is_whole = Number.isInteger(value) && value >= least && value <= most;
    if (!is_whole) fail(place, `is ${JSON.stringify(value)}, must be a whole number in [${least}, ${most}]`);
  }
}
