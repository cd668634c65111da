// SPDX-License-Identifier: Apache-2.0
// The gateway's configuration file. README.md has its fields.
import {readFileSync} from 'node:fs';
import path from 'node:path';
import {isPasswordHash} from './password.js';

const NAME = /^[A-Za-z0-9_.-]{1,64}$/;
const DIGEST = /^[0-9a-fA-F]{64}$/;
const TEXT = (value) => typeof value === 'string' && value !== '';
const whole = (least, most) => (value) => Number.isInteger(value) && value >= least && value <= most;
const object = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

// Field, check and what it must be.
const FIELDS = {
  service: [object, 'an object with address'],
  host: [TEXT, 'a name or an address'],
  port: [whole(1, 65535), 'a number in [1, 65535]'],
  data: [TEXT, 'a folder'],
  clients: [(value) => Array.isArray(value) && value.length > 0, 'a list of one client at least'],
  accept_unknown_certificates: [(value) => typeof value === 'boolean', 'true or false'],
  max_sessions: [whole(1, 10_000), 'a number in [1, 10000]'],
  min_free_bytes: [whole(0, Number.MAX_SAFE_INTEGER), 'a number of bytes'],
};
const SERVICE_FIELDS = {
  address: [TEXT, 'HOST:PORT or unix:PATH'],
  root_certificates: [TEXT, 'a file'],
};
const CLIENT_FIELDS = {
  name: [(value) => NAME.test(value), '1 to 64 letters, digits, "_", "." and "-"'],
  token_file: [TEXT, 'a file'],
  certificate: [TEXT, 'a file'],
  key: [TEXT, 'a file'],
  users: [(value) => object(value) && Object.values(value).every(isPasswordHash),
    'password hashes by user name; node gateway.js hash-password makes one'],
  certificates: [(value) => Array.isArray(value) && value.every((digest) => DIGEST.test(digest)),
    'a list of SHA-256 digests, 64 hexadecimal digits each'],
};

function check(value, fields, required, place) {
  if (!object(value)) throw new Error(`${place}: must be an object`);
  for (const [name, item] of Object.entries(value)) {
    if (!Object.hasOwn(fields, name)) throw new Error(`${place}${name}: is no field; fields are ${Object.keys(fields).join(', ')}`);
    const [is_valid, must_be] = fields[name];
    if (!is_valid(item)) throw new Error(`${place}${name}: must be ${must_be}`);
  }
  for (const name of required) {
    if (!Object.hasOwn(value, name)) throw new Error(`${place}${name}: is missing; must be ${fields[name][1]}`);
  }
}

// Names, users and certificates each belong to one client.
function checkUnique(clients) {
  const owners = new Map();
  const take = (i, field, value) => {
    const key = `${field} ${value}`;
    if (owners.has(key)) throw new Error(`clients[${i}].${field}: ${value}: is of clients[${owners.get(key)}] too`);
    owners.set(key, i);
  };
  clients.forEach((client, i) => {
    take(i, 'name', client.name);
    for (const user of Object.keys(client.users ?? {})) take(i, 'users', user);
    for (const digest of client.certificates ?? []) take(i, 'certificates', digest.toLowerCase());
  });
}

// File names in it are made absolute. Throws an Error with the field and what it must be.
export function readConfiguration(file) {
  try {
    const configuration = JSON.parse(readFileSync(file, 'utf8'));
    check(configuration, FIELDS, ['service', 'data', 'clients'], '');
    check(configuration.service, SERVICE_FIELDS, ['address'], 'service.');
    configuration.clients.forEach((client, i) => check(client, CLIENT_FIELDS, ['name'], `clients[${i}].`));
    checkUnique(configuration.clients);
    const folder = path.dirname(path.resolve(file));
    const resolve = (name) => name && path.resolve(folder, name);
    for (const client of configuration.clients) {
      for (const field of ['token_file', 'certificate', 'key']) client[field] = resolve(client[field]);
    }
    configuration.service.root_certificates = resolve(configuration.service.root_certificates);
    return {port: 4840, max_sessions: 100, min_free_bytes: 2 ** 30, accept_unknown_certificates: false,
      ...configuration, data: resolve(configuration.data)};
  } catch (error) {
    throw new Error(`${file}: ${error.message}`);
  }
}
