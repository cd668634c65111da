// SPDX-License-Identifier: Apache-2.0
// A configuration that is wrong is refused by its field.
import assert from 'node:assert/strict';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {test} from 'node:test';
import {readConfiguration} from '../src/configuration.js';
import {hashPassword, isPassword, isPasswordHash} from '../src/password.js';

const HASH = hashPassword('secret');
const RIGHT = {service: {address: 'localhost:7080'}, data: 'data', clients: [{name: 'mes', users: {mes: HASH}}]};

test('wrong fields are named', (t) => {
  const folder = mkdtempSync(path.join(tmpdir(), 'configuration-'));
  t.after(() => rmSync(folder, {recursive: true}));
  const file = path.join(folder, 'gateway.json');
  const read = (changes) => {
    writeFileSync(file, typeof changes === 'string' ? changes : JSON.stringify({...RIGHT, ...changes}));
    return readConfiguration(file);
  };
  const {data, port, clients, min_free_bytes} = read({});
  assert.deepEqual([data, port, min_free_bytes, clients.length], [path.join(folder, 'data'), 4840, 2 ** 30, 1]);
  const client = (changes) => ({clients: [{name: 'mes', ...changes}]});
  for (const [changes, reason] of [
    ['{', /gateway\.json: .*JSON/],
    [{sevrice: 1}, /sevrice: is no field/],
    [{service: {}}, /service\.address: is missing/],
    [{service: {address: 'a', root_certificate: 'x'}}, /service\.root_certificate: is no field/],
    [{port: '4840'}, /port: must be a number/],
    [{max_sessions: 0}, /max_sessions: must be/],
    [{accept_unknown_certificates: 'false'}, /accept_unknown_certificates: must be true or false/],
    [{clients: []}, /clients: must be/],
    [client({name: 'a/b'}), /clients\[0\]\.name: must be/],
    [client({users: {mes: 'secret'}}), /clients\[0\]\.users: must be password hashes/],
    [client({users: {mes: 'scrypt:00:00'}}), /clients\[0\]\.users: must be password hashes/],
    [client({certificates: ['abc']}), /clients\[0\]\.certificates: must be/],
    [{clients: [{name: 'a'}, {name: 'a'}]}, /clients\[1\]\.name: a: is of clients\[0\] too/],
    [{clients: [{name: 'a', users: {u: HASH}}, {name: 'b', users: {u: HASH}}]}, /clients\[1\]\.users: u: is of clients\[0\] too/],
  ]) assert.throws(() => read(changes), reason, JSON.stringify(changes));
});

test('passwords', async () => {
  assert.ok(isPasswordHash(HASH));
  assert.ok(await isPassword('secret', HASH));
  assert.ok(!await isPassword('Secret', HASH));
  assert.notEqual(hashPassword('secret'), HASH);
});
